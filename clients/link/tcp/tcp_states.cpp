// Requests about whole states of the bench.
#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::link {

using Kind = v1::Envelope::KindCase;

SavedState Link::save_state() {
  v1::Envelope& request = new_request();
  request.mutable_save_state();
  const v1::SavedState& saved = ask(request, Kind::kSavedState).saved_state();
  return {.tick = saved.tick(), .state = saved.state()};
}

std::uint64_t Link::restore_state(std::string_view state) {
  constexpr std::size_t kPart = kMaxRequestFrame / 2;
  for (;;) {
    const std::string_view part = state.substr(0, kPart);
    state.remove_prefix(part.size());
    v1::Envelope& request = new_request();
    request.mutable_restore_state()->set_state(part.data(), part.size());
    request.mutable_restore_state()->set_more(!state.empty());
    const std::uint64_t tick = ask(request, Kind::kDone).done().tick();
    if (state.empty()) return tick;
  }
}

void Link::reset() {
  v1::Envelope& request = new_request();
  request.mutable_reset_bench();
  ask(request, Kind::kDone);
}

}  // namespace drivebench::link
