#include "server/endpoints/tcp/session/requests/states.hpp"

#include <string>
#include <utility>

#include "server/bench/state_limits.hpp"

namespace drivebench {

void States::save() {
  if (!leases_.has_bench_to_itself()) return;
  const std::vector<std::byte> state = dialogue_.engine().save();
  v1::SavedState& saved = *dialogue_.begin_reply(dialogue_.id()).mutable_saved_state();
  saved.set_tick(static_cast<std::uint64_t>(dialogue_.engine().tick()));
  saved.set_state(state.data(), state.size());
  dialogue_.send_reply();
  dialogue_.audit("save", "done", {});
}

void States::restore(const v1::RestoreState& r) {
  Engine& engine = dialogue_.engine();
  std::vector<std::byte> state = std::exchange(parts_, {});
  if (!may_set_back()) return;
  const std::size_t end = state.size() + r.state().size();
  if (end > engine.state_size()) {
    return dialogue_.refuse(dialogue_.id(), v1::REFUSAL_OUT_OF_RANGE,
                            longer_than_a_state(engine.state_size()), "state");
  }
  const auto* const bytes = reinterpret_cast<const std::byte*>(r.state().data());
  state.insert(state.end(), bytes, bytes + r.state().size());
  if (r.more()) {
    parts_ = std::move(state);
    return dialogue_.done(dialogue_.id(), engine.tick());
  }
  const Tick before = engine.tick();
  if (engine.restore(state)) return done("restore", before);
  dialogue_.refuse(dialogue_.id(), v1::REFUSAL_MALFORMED, no_state(state.size()), "state");
}

void States::reset() {
  if (!may_set_back()) return;
  const Tick before = dialogue_.engine().tick();
  dialogue_.engine().reset();
  done("reset", before);
}

bool States::may_set_back() {
  const std::string_view objection = dialogue_.engine().objection_to_restore();
  if (objection.empty()) return leases_.has_bench_to_itself();
  dialogue_.refuse(dialogue_.id(), v1::REFUSAL_NOT_AVAILABLE, std::string(objection), "kind");
  return false;
}

void States::done(const char* event, Tick before) {
  dialogue_.audit(event, "done", {{"from_tick", static_cast<std::uint64_t>(before)}});
  dialogue_.done(dialogue_.id(), dialogue_.engine().tick());
}

}  // namespace drivebench
