#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "protocols/abi/drivebench_bridge.h"

namespace drivebench::shm {

/// The memory that a session at gate level shares with its bench (ShareBridge in bench.proto): a call of
/// protocols/abi/bridge.hpp one way, its results the other. One call is under way at a time.
///
/// The client fills its arguments and then counts `number` of BridgeRequest up; the bench carries the call
/// out and then sets `number` of BridgeReply to the same value. A side that finds nothing new may sleep on
/// the other's number: it first says so (`waits`, `asleep`), and the other side wakes it after a change.
inline constexpr std::uint64_t kBridgeMagic = 0x3173'6567'6462'7264;    // "drbdges1"
inline constexpr std::uint32_t kBridgeVersion = 1;                      ///< of this layout
inline constexpr std::size_t kMostBridgeEdges = 512;                    ///< of one call
inline constexpr std::size_t kMostBridgeState = std::size_t{1} << 16U;  ///< bytes of a saved state

struct BridgeHead {
  std::uint64_t magic = kBridgeMagic;
  std::uint32_t version = kBridgeVersion;
  std::uint32_t state_size = sizeof(drivebench_bridge_state);
  std::uint64_t means_size = sizeof(drivebench_bridge_means);
};

enum class BridgeCall : std::uint64_t {
  kSet = 1,   ///< number: the leg; leg
  kRun,       ///< number: until [ps]; room: edges that may come, 0: they are left out
  kNextEdge,  ///< number: limit [ps]
  kRead,
  kMark,
  kMean,
  kSetLoad,       ///< value [N*m]
  kGetParameter,  ///< name
  kSetParameter,  ///< name, value
  kInject,        ///< name, value
  kClear,
  kSave,
  kRestore,  ///< number: bytes of the state in `bytes`
};

struct BridgeArguments {
  BridgeCall call = BridgeCall::kRead;
  std::uint64_t number = 0;
  std::uint64_t room = 0;
  double value = 0.0;
  drivebench_leg leg{};
  std::array<char, 128> name{};  ///< with a zero behind it
};

/// Written by the client.
struct BridgeRequest {
  std::atomic<std::uint32_t> number{0};  ///< of the newest call, from 1 on
  std::atomic<std::uint32_t> waits{0};   ///< 1: the client sleeps until BridgeReply::number changes
  std::int64_t cpu = -1;                 ///< on which the client runs: a bench on the same one does not spin
  BridgeArguments arguments{};
};

/// Written by the bench.
struct BridgeReply {
  std::atomic<std::uint32_t> number{0};  ///< of the call that this answers
  std::atomic<std::uint32_t> asleep{0};  ///< 1: the bench sleeps until BridgeRequest::number changes
  std::int64_t cpu = -1;                 ///< on which the bench runs
  std::int64_t code = 0;                 ///< a drivebench_code
  std::uint64_t now_ps = 0;
  std::uint64_t count = 0;  ///< of edges; kNextEdge: 1 if there is one, the first; kSave: of bytes
  double value = 0.0;       ///< kGetParameter
  drivebench_bridge_state state{};
  drivebench_bridge_means means{};
  std::array<drivebench_bridge_edge, kMostBridgeEdges> edges{};
  std::array<char, 1024> sentence{};  ///< of a refusal, with a zero behind it
};

struct BridgeSegment {
  BridgeHead head;
  alignas(64) BridgeRequest request;
  alignas(64) BridgeReply reply;
  alignas(64) std::array<std::byte, kMostBridgeState> bytes;  ///< a saved state, either way
};

static_assert(std::is_trivially_copyable_v<BridgeArguments>);

}  // namespace drivebench::shm
