#include "clients/sdk/link_bridge.hpp"

#include <algorithm>
#include <exception>
#include <string>
#include <utility>

#include "protocols/shm/fixed_text.hpp"

namespace drivebench::sdk {
namespace {

using shm::BridgeCall;

/// The address of the session: exchanges stay out of the memory.
link::Address socket_of(link::Address address) {
  address.shares_memory = false;
  address.spin = std::chrono::microseconds(0);
  return address;
}

}  // namespace

LinkBridge::LinkBridge(link::Address address, std::uint32_t axis, const link::LinkOptions& options)
    : link_(socket_of(address), options), memory_(link_.share_bridge(axis, address.spin)) {}

template <class Take>
int LinkBridge::ask(const shm::BridgeArguments& call, Take take) noexcept {
  try {
    memory_->arguments() = call;
    int code = DRIVEBENCH_OK;
    std::string sentence;
    memory_->call([&](const shm::BridgeReply& reply) {
      code = static_cast<int>(reply.code);
      set_time(reply.now_ps, 0);
      // A run in which the machine diverges has edges as well.
      if (code == DRIVEBENCH_OK || code == DRIVEBENCH_LATCHED) take(reply);
      if (code != DRIVEBENCH_OK) sentence = shm::text_in(reply.sentence);
    });
    return code == DRIVEBENCH_OK ? DRIVEBENCH_OK : fail(code, std::move(sentence));
  } catch (const link::LinkError& lost) {
    return fail(DRIVEBENCH_LINK_LOST, lost.what());
  } catch (const std::exception& failure) {
    return fail(DRIVEBENCH_FAILED, failure.what());
  }
}

int LinkBridge::ask(const shm::BridgeArguments& call) noexcept {
  return ask(call, [](const shm::BridgeReply&) {});
}

int LinkBridge::ask_by_name(BridgeCall call, const char* name, double value, double* result) noexcept {
  shm::BridgeArguments arguments{.call = call, .value = value};
  shm::put_text(arguments.name, name);  // the rest of a longer name is unknown as well
  return ask(arguments, [result](const shm::BridgeReply& reply) {
    if (result != nullptr) *result = reply.value;
  });
}

int LinkBridge::set(std::uint32_t leg, const drivebench_leg& setting) noexcept {
  return ask({.call = BridgeCall::kSet, .number = leg, .leg = setting});
}

/// A call brings so many edges; as a run ends early at the edge that fills its room, the next one goes on.
int LinkBridge::run(std::uint64_t until_ps, std::span<drivebench_bridge_edge> edges,
                    std::size_t& count) noexcept {
  count = 0;
  for (;;) {
    const std::size_t room = std::min(edges.size() - count, shm::kMostBridgeEdges);
    std::size_t more = 0;
    const int code =
        ask({.call = BridgeCall::kRun, .number = until_ps, .room = room}, [&](const shm::BridgeReply& reply) {
          more = std::min<std::size_t>(std::uint64_t{reply.count}, room);
          std::copy_n(reply.edges.begin(), more, edges.begin() + static_cast<std::ptrdiff_t>(count));
        });
    count += more;
    const bool goes_on = more == room && more != 0 && count < edges.size();
    if (!goes_on) return code;
  }
}

int LinkBridge::next_edge(std::uint64_t limit_ps, drivebench_bridge_edge& edge, bool& found) noexcept {
  found = false;
  return ask({.call = BridgeCall::kNextEdge, .number = limit_ps}, [&](const shm::BridgeReply& reply) {
    found = reply.count != 0;
    if (found) edge = reply.edges.front();
  });
}

int LinkBridge::read(drivebench_bridge_state& state) noexcept {
  return ask({.call = BridgeCall::kRead}, [&](const shm::BridgeReply& reply) { state = reply.state; });
}

int LinkBridge::mark() noexcept {
  return ask({.call = BridgeCall::kMark});
}

int LinkBridge::mean(drivebench_bridge_means& means) noexcept {
  return ask({.call = BridgeCall::kMean}, [&](const shm::BridgeReply& reply) { means = reply.means; });
}

int LinkBridge::set_load(double load_nm) noexcept {
  return ask({.call = BridgeCall::kSetLoad, .value = load_nm});
}

int LinkBridge::get_parameter(const char* name, double& value) noexcept {
  return ask_by_name(BridgeCall::kGetParameter, name, 0.0, &value);
}

int LinkBridge::set_parameter(const char* name, double value) noexcept {
  return ask_by_name(BridgeCall::kSetParameter, name, value, nullptr);
}

int LinkBridge::inject(const char* name, double value) noexcept {
  return ask_by_name(BridgeCall::kInject, name, value, nullptr);
}

int LinkBridge::clear() noexcept {
  return ask({.call = BridgeCall::kClear});
}

int LinkBridge::save(std::vector<std::byte>& state) noexcept {
  return ask({.call = BridgeCall::kSave}, [&](const shm::BridgeReply& reply) {
    const std::size_t size = std::min<std::size_t>(std::uint64_t{reply.count}, shm::kMostBridgeState);
    state.assign(memory_->bytes(), memory_->bytes() + size);
  });
}

int LinkBridge::restore(std::span<const std::byte> state) noexcept {
  if (state.size() <= shm::kMostBridgeState) std::ranges::copy(state, memory_->bytes());
  return ask({.call = BridgeCall::kRestore, .number = state.size()});
}

}  // namespace drivebench::sdk
