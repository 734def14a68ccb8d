#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "protocols/shm/bridge_segment.hpp"
#include "server/config/config.hpp"
#include "server/endpoints/tcp/memory/sealed_memory.hpp"
#include "server/inproc/inproc_bridge.hpp"

namespace drivebench {

/// A copy of an axis at gate level that one session drives through memory that it shares with the bench
/// (protocols/shm/bridge_segment.hpp). A thread of its own carries the calls out, so that neither a long run
/// nor one that never ends keeps the bench or another session waiting.
class SharedBridge {
 public:
  /// Of an axis without InprocBridge::problem_with(). After a call the thread looks for the next one for so
  /// long before it sleeps. Throws std::system_error.
  SharedBridge(const BenchConfig& config, std::uint32_t axis, std::chrono::microseconds spin);
  /// Waits for the thread: for the part of a run that it is at.
  ~SharedBridge();
  SharedBridge(const SharedBridge&) = delete;
  SharedBridge& operator=(const SharedBridge&) = delete;

  const SealedMemory& memory() const noexcept { return memory_; }
  /// The session has ended: the thread ends soon.
  void end() noexcept;
  bool is_over() const noexcept { return is_over_.load(); }

 private:
  using Clock = std::chrono::steady_clock;

  void serve() noexcept;
  bool await_call(std::uint32_t last) noexcept;
  int carry_out(const shm::BridgeArguments& call) noexcept;
  int run(std::uint64_t until_ps, std::uint64_t room) noexcept;
  int next_edge(std::uint64_t limit_ps) noexcept;
  int save() noexcept;
  int restore(std::uint64_t size) noexcept;

  InprocBridge bridge_;
  SealedMemory memory_;
  shm::BridgeSegment& segment_;
  std::chrono::microseconds spin_;
  std::atomic<bool> ends_{false};
  std::atomic<bool> is_over_{false};
  std::thread thread_;
};

/// The bridges of all sessions.
class SharedBridges {
 public:
  static constexpr std::size_t kMost = 4;

  /// Null: there are kMost already. Throws std::system_error.
  std::shared_ptr<SharedBridge> open(const BenchConfig& config, std::uint32_t axis,
                                     std::chrono::microseconds spin);

 private:
  std::vector<std::shared_ptr<SharedBridge>> all_;
};

}  // namespace drivebench
