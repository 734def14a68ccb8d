#include "server/recording/recording_writer.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "protocols/descriptor_set.hpp"
#include "protocols/mcap/mcap_series.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"
#include "server/host/build_id.hpp"
#include "server/host/logging/log.hpp"
#include "server/recording/recording.hpp"

namespace drivebench {
namespace {

/// The interval in plant time, so that the same run gives the same file, byte for byte. A free run takes some
/// milliseconds for a second of it.
std::int64_t chunk_ns(const RecordingOptions& options, RunMode mode) {
  if (options.chunk_ns > 0) return options.chunk_ns;
  return mode == RunMode::kFree ? 1'000'000'000 : 100'000'000;
}
constexpr auto kSyncInterval = std::chrono::seconds(1);
/// The most bytes between two checks of the free space: a free run writes hundreds of megabytes in a second.
constexpr std::uint64_t kBytesPerLook = std::uint64_t{16} << 20;

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

constexpr std::array<const char*, 7> kStepNames{"open",
                                                "write",
                                                "sync",
                                                "close",
                                                "memory",
                                                "another program removed it",
                                                "another program emptied or changed it"};
/// Beyond this length further remarks are only logged.
constexpr std::size_t kMaxRemarkBytes = 1000;

/// Errors that a new file would have as well.
bool is_of_space(int error) noexcept {
  return error == ENOSPC || error == EFBIG || error == EDQUOT;
}

/// The unit of each field of a sample, for viewers.
McapMap units_of_signals() {
  McapMap units;
  for (const Signal& signal : kSignals)
    units.emplace("unit." + std::string(signal.name), signal.unit);
  return units;
}

}  // namespace

/// An error of the disk. The MCAP writer cannot be used after it.
struct RecordingWriter::DiskError {
  Step step;
  int error;
};

RecordingWriter::RecordingWriter(const std::filesystem::path& file, const BenchConfig& config,
                                 std::initializer_list<RecordingAttachment> attachments,
                                 const RecordingOptions& options)
    : first_(file.string()),
      config_(config),
      options_(options),
      tables_(parameter_tables(config.setup)),
      flush_ticks_(static_cast<std::uint64_t>(
          std::max<std::int64_t>(chunk_ns(options, config.mode) / config.setup.period_ns, 1))),
      sequences_(config.axes.size()) {
  for (const RecordingAttachment& a : attachments)
    attachments_.push_back({std::string(a.name), std::string(a.media_type), std::string(a.data)});
  if (const std::string second = segment_path(first_, 2); std::filesystem::exists(second)) {
    throw std::system_error(EEXIST, std::generic_category(),
                            "cannot create the recording: it would go on in " + second);
  }
  if (!options_.create) options_.create = create_recording_file;
  std::unique_ptr<RecordingFile> made = options_.create(file);
  if (made->free_bytes() < options_.reserve_bytes) {
    std::filesystem::remove(file);
    throw std::system_error(ENOSPC, std::generic_category(),
                            "cannot create the recording " + first_ + ": less than " +
                                std::to_string(options_.reserve_bytes >> 20) + " MiB are free on its disk");
  }
  attempt([&] { begin(first_, std::move(made)); });
}

RecordingWriter::~RecordingWriter() = default;

void RecordingWriter::begin(const std::string& path, std::unique_ptr<RecordingFile> file) {
  mcap_.reset();
  file_ = std::move(file);
  path_ = path;
  if (name_.empty()) name_ = path;
  whole_bytes_ = unwritten_ = unsynced_ = segment_samples_ = segment_entries_ = 0;
  was_synced_ = is_ending_ = false;
  samples_.clear();
  mcap_.emplace([this](std::span<const std::byte> bytes) { write_all(bytes); },
                McapWriterOptions{.profile = std::string(kRecordingProfile), .library = recorder_name()});
  if (number_ > 1)
    mcap_->add_metadata(kSegmentMetadata, {{std::string(kSegmentNumber), std::to_string(number_)}});
  if (time_base_) mcap_->add_metadata(kTimeBaseMetadata, entries_of(*time_base_));
  mcap_->add_attachment(kConfigurationAttachment, "application/toml", 0, bytes_of(to_toml(config_)));
  for (const Attachment& a : attachments_)
    mcap_->add_attachment(a.name, a.media_type, 0, bytes_of(a.data));
  const std::string descriptors = bench_descriptor_set();
  const auto schema = [&](const char* name) {
    return mcap_->add_schema(name, "protobuf", bytes_of(descriptors));
  };
  const std::uint16_t sample = schema("drivebench.v1.Sample");
  inputs_ = mcap_->add_channel(kInputTopic, schema("drivebench.v1.Input"), "protobuf");
  verdict_ = mcap_->add_channel(kVerdictTopic, schema("drivebench.v1.Verdict"), "protobuf");
  for (const AxisConfig& axis : config_.axes)
    samples_.push_back(mcap_->add_channel(sample_topic(axis.name), sample, "protobuf", units_of_signals()));
}

/// Runs an action that fails if the disk or the memory does.
template <class Action>
void RecordingWriter::attempt(Action action) noexcept {
  try {
    action();
    return;
  } catch (const DiskError& e) {
    fail(e.step, e.error);
  } catch (const std::system_error& e) {
    fail(Step::kOpen, e.code().value());
  } catch (const std::exception&) {
    fail(Step::kMemory, ENOMEM);
  }
  if (!is_over_) go_on();
}

void RecordingWriter::go_on() noexcept {
  attempt([this] { begin_next(); });
}

void RecordingWriter::begin_next() {
  const std::string path = segment_path(first_, ++number_);
  begin(path, options_.create(path));
}

void RecordingWriter::write(const RecordedEntry& entry) noexcept {
  const auto* const sample = std::get_if<TickedSample>(&entry);
  if (!is_over_ && sample != nullptr && sample->axis == 0 && sample->sample.tick % flush_ticks_ == 0) {
    attempt([this] { mcap_->flush(); });
  }
  if (is_over_) {
    ++lost_;
    return;
  }
  attempt([&] {
    std::visit([this](const auto& e) { put(e); }, entry);
    if (unlooked_bytes_ >= kBytesPerLook) end_if_room_is_short();
    if (is_over_ || !is_full(entry)) return;
    end_file();
    begin_next();
  });
}

void RecordingWriter::put(const TickedSample& entry) {
  count_entry();
  const auto room = mcap_->begin_message(
      header(samples_[entry.axis], sequences_[entry.axis]++, entry.sample.tick), kMaxSampleBytes);
  mcap_->end_message(encode_sample(entry.sample, kAllSignals, room.data()));
  if (entry.axis == 0) ++segment_samples_;
}

void RecordingWriter::put(const ReceivedInput& entry) {
  count_entry();
  encode_input(entry.received, entry.input, tables_, input_);
  add(inputs_, input_sequence_++, static_cast<std::uint64_t>(entry.received), input_);
}

void RecordingWriter::put(const TimeBase& base) {
  count_entry();
  time_base_ = base;
  mcap_->add_metadata(kTimeBaseMetadata, entries_of(base));
}

void RecordingWriter::put(const Verdict& verdict) {
  count_entry();
  v1::Verdict message;
  encode_verdict(verdict, message);
  add(verdict_, 0, verdict.ticks, message);
}

void RecordingWriter::add(std::uint16_t channel, std::uint32_t sequence, std::uint64_t tick,
                          const google::protobuf::Message& message) {
  const std::size_t size = message.ByteSizeLong();
  const auto room = mcap_->begin_message(header(channel, sequence, tick), size);
  message.SerializeToArray(room.data(), static_cast<int>(size));
  mcap_->end_message(size);
}

McapMessageHeader RecordingWriter::header(std::uint16_t channel, std::uint32_t sequence,
                                          std::uint64_t tick) const {
  const std::uint64_t time_ns = tick * static_cast<std::uint64_t>(config_.setup.period_ns);
  return {.channel = channel, .sequence = sequence, .log_time_ns = time_ns, .publish_time_ns = time_ns};
}

/// Files end after the last sample of a tick, so that each holds whole ticks.
bool RecordingWriter::is_full(const RecordedEntry& last) const {
  const auto* const sample = std::get_if<TickedSample>(&last);
  if (sample == nullptr || sample->axis + 1 < samples_.size()) return false;
  if (options_.file_ticks > 0 && segment_samples_ >= options_.file_ticks) return true;
  return options_.file_bytes > 0 && mcap_->bytes_written() >= options_.file_bytes;
}

void RecordingWriter::write_all(std::span<const std::byte> bytes) {
  std::span<const std::byte> rest = bytes;
  while (!rest.empty()) {
    errno = ENOSPC;  // the disk wrote nothing and set no error
    const ssize_t written = file_->write(rest);
    if (written > 0) {
      rest = rest.subspan(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      throw DiskError{Step::kWrite, errno};
    }
  }
  whole_bytes_ += bytes.size();
  unlooked_bytes_ += bytes.size();
  unsynced_ += std::exchange(unwritten_, 0);  // one call brings a whole chunk
}

void RecordingWriter::sync_if_due(Clock::time_point now) noexcept {
  if (is_over_ || now - last_sync_ < kSyncInterval) return;
  last_sync_ = now;
  attempt([this] {
    sync();
    end_if_room_is_short();
  });
}

/// Ends the recording with a complete file while the reserve is free.
void RecordingWriter::end_if_room_is_short() {
  unlooked_bytes_ = 0;
  if (file_->free_bytes() >= options_.reserve_bytes) return;
  is_over_ = lacks_room_ = true;
  options_.continues_after_errors = false;  // also if the end of this file cannot be written
  end_file();
  remark(fmt::format("{}: less than {} MiB are free on its disk, it ends here", path_,
                     options_.reserve_bytes >> 20));
}

void RecordingWriter::sync() {
  if (file_->sync() != 0) throw DiskError{Step::kSync, errno};
  was_synced_ = true;
  unsynced_ = 0;
  look_at_file();
}

/// Notices what other programs have done to the current file. A finished one belongs to the user.
void RecordingWriter::look_at_file() {
  const FileFate fate = file_->fate(path_, whole_bytes_);
  switch (fate.kind) {
    case FileFate::Kind::kKept:
      return;
    case FileFate::Kind::kRemoved:
      throw DiskError{Step::kRemoved, 0};
    case FileFate::Kind::kChanged:
      throw DiskError{Step::kChanged, 0};
    case FileFate::Kind::kMoved:
      break;
  }
  remark(path_ + ": another program moved it" + (fate.path.empty() ? "" : " to " + fate.path));
  if (name_ == path_ && !fate.path.empty()) name_ = fate.path;
  path_ = fate.path;
}

void RecordingWriter::remark(const std::string& what) {
  log::error("recording {}", what);
  if (remarks_.size() > kMaxRemarkBytes) return;
  remarks_ += (remarks_.empty() ? "" : "; ") + what;
}

void RecordingWriter::end_file() {
  is_ending_ = true;
  mcap_->finish();
  sync();
  if (file_->close() != 0) throw DiskError{Step::kClose, errno};
  is_ending_ = false;
}

void RecordingWriter::finish(const Verdict& verdict) noexcept {
  if (is_over_) {
    ++lost_;
    return;
  }
  options_.continues_after_errors = false;  // no more entries follow
  attempt([&] {
    put(verdict);
    end_file();
  });
}

/// Whether another program removed or emptied the file that this step could not go on with.
bool RecordingWriter::has_lost_file(Step step) noexcept {
  if (step != Step::kWrite && step != Step::kSync) return false;
  try {
    const FileFate::Kind fate = file_->fate(path_, whole_bytes_).kind;
    return fate == FileFate::Kind::kRemoved || fate == FileFate::Kind::kChanged;
  } catch (const std::exception&) {
    return false;  // no memory for the name of a file that was moved
  }
}

/// Gives up the current file. A failed sync is not repeated: the system may have dropped the pages, and
/// reports that only once.
void RecordingWriter::fail(Step step, int error) noexcept {
  // After a failed write the earlier chunks stay readable; after a failed sync that is unknown.
  const bool is_unsure = step == Step::kSync || step == Step::kClose;
  if (step == Step::kWrite)
    file_->truncate(whole_bytes_);  // if this fails the torn chunk stays, and readers report it
  const bool is_gone = step == Step::kRemoved || step == Step::kChanged || has_lost_file(step);
  const std::uint64_t lost = is_gone ? segment_entries_ : unwritten_ + (is_unsure ? unsynced_ : 0);
  is_over_ = !options_.continues_after_errors || step == Step::kOpen || is_of_space(error) ||
             (number_ > 1 && !was_synced_);
  lacks_room_ = lacks_room_ || is_of_space(error);
  // A file without its end or its beginning does not replay even if no entry is missing.
  lost_ += std::max<std::uint64_t>(lost, is_ending_ || !is_over_ ? 1 : 0);
  unwritten_ = unsynced_ = segment_entries_ = 0;
  is_ending_ = false;
  try {
    const std::string file = step == Step::kOpen ? segment_path(first_, number_) : path_;
    remark(fmt::format("{}: {}{}{}, {}", file, kStepNames[static_cast<std::size_t>(step)],
                       error == 0 ? "" : ": ", error == 0 ? "" : std::strerror(error),
                       is_over_ ? "it ends here" : "it goes on in a new file"));
    if (is_gone && name_ == path_) name_.clear();
  } catch (const std::exception&) {
    return;  // the loss is counted
  }
}

}  // namespace drivebench
