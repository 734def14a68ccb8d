#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "bench.pb.h"
#include "protocols/mcap/mcap.hpp"
#include "protocols/mcap/time_base.hpp"
#include "server/config/config.hpp"
#include "server/host/clock.hpp"
#include "server/pacing/verdict.hpp"
#include "server/recording/input_codec.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/recording_file.hpp"

namespace drivebench {

/// Writes the files of a recording, from the first entry to the verdict; one thread, without a clock. After a
/// disk error it leaves the file without an end and counts the entries that may not be on the disk as lost.
class RecordingWriter {
 public:
  using Clock = ServerClock;

  /// Begins the first file; throws std::system_error if a name of the series is taken, the file cannot be
  /// created, or less than the reserve is free.
  RecordingWriter(const std::filesystem::path& file, const BenchConfig& config,
                  std::initializer_list<RecordingAttachment> attachments, const RecordingOptions& options);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  void write(const RecordedEntry& entry) noexcept;
  /// Syncs the file if the last sync was a second ago.
  void sync_if_due(Clock::time_point now) noexcept;
  /// Ends the last file.
  void finish(const Verdict& verdict) noexcept;

  /// Whether the recording has ended early: every further entry counts as lost.
  bool is_over() const noexcept { return is_over_; }
  /// Whether it has ended because the disk is full or has less than the reserve.
  bool lacks_room() const noexcept { return lacks_room_; }
  /// The number of entries given to write() that may not be on the disk; each is returned once.
  std::uint64_t take_lost() noexcept { return std::exchange(lost_, 0); }
  std::size_t files() const noexcept { return number_; }
  /// The present name of the first file that is still there; empty if none is.
  const std::string& file() const noexcept { return name_; }
  /// The damage by disks and other programs, in a sentence; empty: none.
  const std::string& remarks() const noexcept { return remarks_; }

 private:
  struct Attachment {
    std::string name;
    std::string media_type;
    std::string data;
  };

  /// The steps that a disk can refuse, and the ends that another program can bring to a file.
  enum class Step { kOpen, kWrite, kSync, kClose, kMemory, kRemoved, kChanged };
  struct DiskError;

  void begin(const std::string& path, std::unique_ptr<RecordingFile> file);
  void count_entry() noexcept {
    ++unwritten_;
    ++segment_entries_;
  }
  void put(const TickedSample& entry);
  void put(const ReceivedInput& entry);
  void put(const TimeBase& base);
  void put(const Verdict& verdict);
  void add(std::uint16_t channel, std::uint32_t sequence, std::uint64_t tick,
           const google::protobuf::Message& message);
  McapMessageHeader header(std::uint16_t channel, std::uint32_t sequence, std::uint64_t tick) const;
  void write_all(std::span<const std::byte> bytes);
  void begin_next();
  void go_on() noexcept;
  void sync();
  void look_at_file();
  bool has_lost_file(Step step) noexcept;
  void remark(const std::string& what);
  void end_file();
  void end_if_room_is_short();
  bool is_full(const RecordedEntry& last) const;
  void fail(Step step, int error) noexcept;
  template <class Action>
  void attempt(Action action) noexcept;

  std::string first_;
  BenchConfig config_;
  std::vector<Attachment> attachments_;
  RecordingOptions options_;
  ParameterTables tables_;
  std::uint64_t flush_ticks_;
  std::size_t number_ = 1;
  std::vector<std::uint32_t> sequences_;  // of the samples, by axis
  std::uint32_t input_sequence_ = 0;
  v1::Input input_;
  std::optional<TimeBase> time_base_;  // the newest; each file begins with it
  Clock::time_point last_sync_ = Clock::now();
  std::uint64_t lost_ = 0;
  std::uint64_t unlooked_bytes_ = 0;  // written since the last check of the free space
  std::string name_;
  std::string remarks_;
  bool is_over_ = false;
  bool lacks_room_ = false;

  // State of the current file.
  std::string path_;  // its present name; empty: unknown
  std::unique_ptr<RecordingFile> file_;
  std::optional<McapWriter> mcap_;
  std::uint16_t inputs_ = 0;
  std::uint16_t verdict_ = 0;
  std::vector<std::uint16_t> samples_;
  std::uint64_t whole_bytes_ = 0;  // up to the end of the last whole chunk
  std::uint64_t unwritten_ = 0;    // entries in the chunk that is being filled
  std::uint64_t unsynced_ = 0;     // entries written since the last sync
  std::uint64_t segment_samples_ = 0;
  std::uint64_t segment_entries_ = 0;
  bool was_synced_ = false;
  bool is_ending_ = false;
};

}  // namespace drivebench
