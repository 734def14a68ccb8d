#include "server/endpoints/tcp/memory/shared_bridge.hpp"

#include <sched.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <span>
#include <string>

#include "protocols/shm/fixed_text.hpp"
#include "protocols/shm/futex.hpp"
#include "protocols/shm/segment.hpp"

namespace drivebench {
namespace {

constexpr std::uint64_t kPsInMs = 1'000'000'000;
/// A run or a look ahead is carried out in parts, between which the thread looks whether the session has
/// ended: its result does not depend on them.
constexpr std::uint64_t kPartPs = kPsInMs;
constexpr std::uint64_t kFarthestLookPs = 1000 * kPsInMs;
/// A session that has ended is noticed so soon where nothing wakes the thread.
constexpr std::chrono::milliseconds kLook{100};

}  // namespace

SharedBridge::SharedBridge(const BenchConfig& config, std::uint32_t axis, std::chrono::microseconds spin)
    : bridge_(config, axis),
      memory_(sizeof(shm::BridgeSegment)),
      segment_(*std::construct_at(static_cast<shm::BridgeSegment*>(memory_.address()))),
      spin_(spin),
      thread_([this] { serve(); }) {}

SharedBridge::~SharedBridge() {
  end();
  thread_.join();
}

void SharedBridge::end() noexcept {
  ends_.store(true);
  shm::wake(segment_.request.number);
}

void SharedBridge::serve() noexcept {
  shm::BridgeReply& reply = segment_.reply;
  for (std::uint32_t last = 0; await_call(last);) {
    const std::uint32_t number = segment_.request.number.load();
    // A copy: the client might change it meanwhile.
    shm::BridgeArguments call;
    std::memcpy(&call, &segment_.request.arguments, sizeof call);
    std::atomic_signal_fence(std::memory_order_seq_cst);
    call.name.back() = '\0';
    reply.count = 0;
    bridge_.forget_error();
    const bool is_next = number == last + 1;
    const int code = is_next ? carry_out(call)
                             : bridge_.fail(DRIVEBENCH_MALFORMED,
                                            "the number of a call is not that of the last one and 1 more");
    if (ends_.load()) break;  // a run may have stopped on its way
    if (code != DRIVEBENCH_OK) shm::put_text(reply.sentence, bridge_.error());
    reply.code = code;
    reply.now_ps = bridge_.now_ps();
    reply.cpu = ::sched_getcpu();
    reply.number.store(number);
    if (segment_.request.waits.load() != 0) shm::wake(reply.number);
    last = number;
  }
  memory_.forget();
  shm::wake(reply.number);  // a client that sleeps sees the end of its session
  is_over_.store(true);
}

/// Whether there is one; else the session has ended.
bool SharedBridge::await_call(std::uint32_t last) noexcept {
  const std::atomic<std::uint32_t>& number = segment_.request.number;
  const auto has_come = [&number, last] { return number.load() != last; };
  // On one CPU the client cannot go on while the bench spins.
  const bool may_spin = segment_.request.cpu != ::sched_getcpu();
  for (const Clock::time_point start = Clock::now(); may_spin && Clock::now() - start < spin_;) {
    for (int looks = 0; looks < 16; ++looks) {
      if (has_come()) return !ends_.load();
      shm::spin();
    }
  }
  segment_.reply.asleep.store(1);
  while (!ends_.load() && !has_come())
    shm::sleep_while(number, last, kLook);
  segment_.reply.asleep.store(0);
  return !ends_.load();
}

int SharedBridge::carry_out(const shm::BridgeArguments& call) noexcept {
  using enum shm::BridgeCall;
  shm::BridgeReply& reply = segment_.reply;
  switch (call.call) {
    case kSet:
      return bridge_.set(static_cast<std::uint32_t>(std::min<std::uint64_t>(call.number, 0xFFFF)), call.leg);
    case kRun:
      return run(call.number, call.room);
    case kNextEdge:
      return next_edge(call.number);
    case kRead:
      return bridge_.read(reply.state);
    case kMark:
      return bridge_.mark();
    case kMean:
      return bridge_.mean(reply.means);
    case kSetLoad:
      return bridge_.set_load(call.value);
    case kGetParameter:
      return bridge_.get_parameter(call.name.data(), reply.value);
    case kSetParameter:
      return bridge_.set_parameter(call.name.data(), call.value);
    case kInject:
      return bridge_.inject(call.name.data(), call.value);
    case kClear:
      return bridge_.clear();
    case kSave:
      return save();
    case kRestore:
      return restore(call.number);
  }
  return bridge_.fail(
      DRIVEBENCH_MALFORMED,
      "call is " + std::to_string(static_cast<std::uint64_t>(call.call)) + " but must be 1 to 13");
}

int SharedBridge::run(std::uint64_t until_ps, std::uint64_t room) noexcept {
  const std::span<drivebench_bridge_edge> edges =
      std::span(segment_.reply.edges).first(std::min<std::uint64_t>(room, shm::kMostBridgeEdges));
  std::size_t count = 0;
  for (;;) {
    const std::uint64_t now_ps = bridge_.now_ps();
    const bool is_refused = until_ps < now_ps || until_ps > kLastBridgePs;
    const bool is_last = is_refused || until_ps - now_ps <= kPartPs;
    std::size_t more = 0;
    const int code = bridge_.run(is_last ? until_ps : now_ps + kPartPs, edges.subspan(count), more);
    count += more;
    segment_.reply.count = count;
    const bool is_full = !edges.empty() && count == edges.size();
    if (is_last || is_full || ends_.load()) return code;
  }
}

int SharedBridge::next_edge(std::uint64_t limit_ps) noexcept {
  const std::uint64_t now_ps = bridge_.now_ps();
  if (limit_ps > now_ps && limit_ps - now_ps > kFarthestLookPs) {
    return bridge_.fail(DRIVEBENCH_OUT_OF_RANGE, "limit_ps is " + std::to_string(limit_ps) +
                                                     " but a bench in another process looks 1 s " +
                                                     "ahead at most, to " +
                                                     std::to_string(now_ps + kFarthestLookPs));
  }
  // In parts, too: each goes on from where the last one has looked to.
  for (std::uint64_t to_ps = now_ps;;) {
    const bool is_last = limit_ps < to_ps || limit_ps - to_ps <= kPartPs;
    to_ps = is_last ? limit_ps : to_ps + kPartPs;
    bool is_there = false;
    const int code = bridge_.next_edge(to_ps, segment_.reply.edges.front(), is_there);
    segment_.reply.count = is_there ? 1 : 0;
    if (code != DRIVEBENCH_OK || is_last || is_there || ends_.load()) return code;
  }
}

int SharedBridge::save() noexcept {
  std::vector<std::byte> state;
  if (const int code = bridge_.save(state); code != DRIVEBENCH_OK) return code;
  if (state.size() > segment_.bytes.size()) {
    return bridge_.fail(DRIVEBENCH_FAILED, "a state of " + std::to_string(state.size()) +
                                               " bytes does not fit into the shared memory");
  }
  std::ranges::copy(state, segment_.bytes.begin());
  segment_.reply.count = state.size();
  return DRIVEBENCH_OK;
}

int SharedBridge::restore(std::uint64_t size) noexcept {
  if (size > segment_.bytes.size()) {
    return bridge_.fail(DRIVEBENCH_MALFORMED, "size is " + std::to_string(size) + " but must be at most " +
                                                  std::to_string(segment_.bytes.size()));
  }
  // A copy: the client might change it while it is checked.
  const std::vector<std::byte> state(segment_.bytes.begin(),
                                     segment_.bytes.begin() + static_cast<std::ptrdiff_t>(size));
  return bridge_.restore(state);
}

std::shared_ptr<SharedBridge> SharedBridges::open(const BenchConfig& config, std::uint32_t axis,
                                                  std::chrono::microseconds spin) {
  std::erase_if(all_, [](const std::shared_ptr<SharedBridge>& each) { return each->is_over(); });
  if (all_.size() == kMost) return nullptr;
  return all_.emplace_back(std::make_shared<SharedBridge>(config, axis, spin));
}

}  // namespace drivebench
