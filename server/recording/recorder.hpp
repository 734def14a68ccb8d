#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <variant>

#include "protocols/mcap/time_base.hpp"
#include "server/bench/bench.hpp"
#include "server/config/config.hpp"
#include "server/pacing/verdict.hpp"
#include "server/recording/recording.hpp"
#include "server/recording/recording_file.hpp"
#include "server/recording/spsc_queue.hpp"

namespace drivebench {

class RecordingWriter;

/// An input in the queue.
struct ReceivedInput {
  ReceivedInput(Tick at, const Input& taken) noexcept : received(at), input(taken) {}
  Tick received;
  Input input;
};
using RecordedEntry = std::variant<TickedSample, ReceivedInput, TimeBase>;

/// The space that recordings leave free on their disk for other writers: the audit log, the system.
inline constexpr std::uint64_t kDiskReserveBytes = std::uint64_t{64} << 20;

/// Options of a recording. By default it has one file and ends at the first disk error.
struct RecordingOptions {
  std::uint64_t file_ticks = 0;  ///< a new file begins after this many ticks; 0: never
  std::uint64_t file_bytes = 0;  ///< a new file begins after the chunk that reaches this size; 0: never
  std::int64_t chunk_ns = 0;     ///< plant time in a chunk, the most that a kill loses; 0: the default
  bool continues_after_errors = false;  ///< goes on in a new file after a disk error, unless the disk is full
  std::uint64_t reserve_bytes = 0;      ///< the recording ends before less than this is free on its disk
  CreateRecordingFile create{};         ///< empty: create_recording_file
  bool own_thread = true;               ///< false: the caller calls work() regularly
};

/// The size of the queue in entries: a sample and a command per tick and axis for two seconds, at most 256
/// MiB.
std::size_t recorder_queue_entries(const BenchConfig& config) noexcept;

/// Writes every sample and every input of a run to MCAP files, on a thread of its own behind a bounded queue.
/// The tick only copies into the queue; when the queue is full the entry is lost and counted. The thread
/// writes the entries after every 100 ms of plant time (1 s in free mode) by default and syncs the file every
/// second.
class Recorder final : public BenchObserver {
 public:
  /// Creates the file; throws std::system_error if it exists or cannot be created.
  Recorder(const std::filesystem::path& file, const BenchConfig& config,
           std::initializer_list<RecordingAttachment> attachments = {}, const RecordingOptions& options = {});
  ~Recorder() override;
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void on_input(Tick now, const Input& input) noexcept override;
  void on_sample(std::uint32_t axis, const Sample& sample) noexcept override;
  /// From here on the ticks are due by this wall time. Called by the tick thread between ticks.
  void on_time_base(const TimeBase& base) noexcept {
    new_base_ = base;
    offer_time_base();
  }

  /// Whether the queue has room for a tick. Called by the tick thread between ticks.
  bool has_room() noexcept { return queue_.room() >= room_for_tick_; }
  /// Waits until has_room(). For runs without real time.
  void wait_for_room() noexcept;

  /// Writes some entries of the queue and syncs when due; false if the queue was empty.
  bool work() noexcept;

  /// Entries lost because the queue was full or the disk refused them.
  std::uint64_t gaps() const noexcept { return gaps_.load(std::memory_order_relaxed); }
  /// Whether the recording has ended before the run, because the disk is full or has failed.
  bool is_over() const noexcept { return is_over_.load(std::memory_order_relaxed); }
  /// Whether it has ended because the disk is full or has less than its reserve.
  bool lacks_room() const noexcept { return lacks_room_.load(std::memory_order_relaxed); }
  /// The present name of the recording's first file that is still there; empty if none is.
  std::string file() const;
  /// The damage by disks and other programs, in a sentence; empty: none.
  std::string remarks() const;

  /// Drains the queue, writes the verdict and closes the file; afterwards the state above is final. Returns
  /// the verdict with what became of the recording.
  Verdict finish(const Verdict& verdict);

 private:
  void count_gap(bool lost) noexcept;
  void run();
  bool drain(std::size_t most) noexcept;
  void offer_time_base() noexcept;
  void tell_state() noexcept;

  SpscQueue<RecordedEntry> queue_;
  std::size_t room_for_tick_;
  std::optional<TimeBase> new_base_;  // tick thread: not in the queue yet, which was full
  std::unique_ptr<RecordingWriter> writer_;
  std::atomic<std::uint64_t> gaps_{0};
  std::atomic<bool> is_over_{false};
  std::atomic<bool> lacks_room_{false};
  std::atomic<bool> stop_{false};
  mutable std::mutex mutex_;  // guards the two strings; no tick takes it
  std::string file_;
  std::string remarks_;
  std::thread thread_;
};

}  // namespace drivebench
