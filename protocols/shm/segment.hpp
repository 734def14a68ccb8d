#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "protocols/signals/command.hpp"
#include "protocols/signals/edge_record.hpp"
#include "protocols/signals/sample.hpp"

/// The memory that a bench and one session share (ShareMemory in bench.proto): the commands of an exchange
/// one way, its samples or its refusal the other. One exchange is under way at a time.
///
/// The client fills Request and then counts its number up; the bench answers and then sets the number of
/// Reply to the same value. So neither side reads what the other one is writing. A side that finds nothing
/// new may sleep: it first says so (`waits`, `asleep`) and then looks once more, and the other side wakes it
/// after a change. The client sleeps on the futex Reply::number, the bench until a byte comes through the
/// bell, a socket.
///
/// All of it is in the byte order and the layout of the machine, which both sides share.
namespace drivebench::shm {

inline constexpr std::uint64_t kMagic = 0x68636e6562767264;  // "drvbench"
inline constexpr std::uint32_t kVersion = 1;                 ///< of this layout, samples apart
inline constexpr std::size_t kMaxAxes = 64;
/// The longest time that the bench looks for the next exchange before it sleeps [us].
inline constexpr std::uint32_t kMaxSpinUs = 100;

/// What the bench has written before the client sees the memory.
struct Head {
  std::uint64_t magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t sample_words = kSampleWords;  ///< 8-byte words of a Sample
  std::uint64_t axes = 0;
};

/// The command for an axis, in answer to the sample of `tick`. The numbers are those of Command in
/// bench.proto.
struct CommandRecord {
  std::uint64_t axis;
  std::uint64_t tick;
  std::int64_t gates;
  std::uint64_t legs_off;
  PhaseValues setpoint;  ///< [V]; by the gates [A] or duties
  EdgeRecords edges;     ///< Gates::kEdges
};

/// Written by the client.
struct Request {
  std::atomic<std::uint32_t> number{0};  ///< of the newest exchange, from 1 on
  std::atomic<std::uint32_t> waits{0};   ///< 1: the client sleeps until Reply::number changes
  std::int64_t cpu = -1;                 ///< on which the client runs: a bench on the same one does not spin
  std::uint64_t count = 0;               ///< commands; 0 asks for the newest sample of every axis
  std::array<CommandRecord, kMaxAxes> commands{};
};

/// The newest sample of an axis.
struct SampleRecord {
  std::uint64_t axis;
  Sample sample;
};

/// Written by the bench.
struct Reply {
  std::atomic<std::uint32_t> number{0};  ///< of the exchange that this answers
  std::atomic<std::uint32_t> asleep{0};  ///< 1: the bench waits for the bell
  std::int64_t cpu = -1;                 ///< on which the bench runs
  std::uint64_t code = 0;                ///< a RefusalCode; 0: samples follow
  std::uint64_t count = 0;               ///< samples
  std::array<char, 1024> sentence{};     ///< of a refusal, with a zero behind it
  std::array<char, 64> field{};          ///< that is refused, with a zero behind it
};

/// The beginning of the memory. `reply` is followed by a SampleRecord for each axis.
struct Segment {
  Head head;
  alignas(64) Request request;
  alignas(64) Reply reply;
};

static_assert(std::atomic<std::uint32_t>::is_always_lock_free && sizeof(std::atomic<std::uint32_t>) == 4);
static_assert(std::is_trivially_copyable_v<CommandRecord> && std::is_trivially_copyable_v<SampleRecord>);
static_assert(sizeof(Segment) % alignof(SampleRecord) == 0);

constexpr std::size_t segment_bytes(std::size_t axes) noexcept {
  return sizeof(Segment) + axes * sizeof(SampleRecord);
}

/// The samples behind the segment.
inline SampleRecord* samples_of(Segment& segment) noexcept {
  return reinterpret_cast<SampleRecord*>(&segment + 1);
}

/// Tells the processor that this thread spins.
inline void spin() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

}  // namespace drivebench::shm
