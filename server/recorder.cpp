#include "server/recorder.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>

#include "bench.pb.h"
#include "protocols/descriptor_set.hpp"
#include "protocols/mcap.hpp"
#include "protocols/sample_codec.hpp"
#include "server/build_id.hpp"
#include "server/input_codec.hpp"
#include "server/recording.hpp"

namespace drivebench {
namespace {

using Clock = std::chrono::steady_clock;

/// In plant time, not wall time: the same run gives the same file, byte for byte. A free run is over a second
/// of it in some milliseconds.
std::int64_t flush_interval_ns(RunMode mode) {
  return mode == RunMode::kFree ? 1'000'000'000 : 100'000'000;
}
constexpr auto kSyncInterval = std::chrono::seconds(1);
constexpr auto kIdleSleep = std::chrono::milliseconds(1);

/// At most a quarter of a gigabyte, whatever the configuration asks for.
constexpr std::size_t kMaxRingEntries = std::size_t{1} << 20;

/// Two seconds of entries: one sample of each axis and a few inputs for each tick.
std::size_t ring_capacity(const BenchConfig& config) {
  const double ticks = 2e9 / static_cast<double>(config.setup.period_ns);
  const auto entries = static_cast<std::size_t>(ticks * static_cast<double>(config.axes.size())) + 1024;
  return std::min(entries, kMaxRingEntries);
}

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

}  // namespace

/// The file and its MCAP structure. After the first failed write nothing more is written; what was on its way
/// then and every later entry count as lost.
class Recorder::File {
 public:
  File(const std::filesystem::path& path, const BenchConfig& config,
       std::initializer_list<RecordingAttachment> attachments)
      : tables_(parameter_tables(config.setup)),
        period_ns_(config.setup.period_ns),
        flush_ticks_(static_cast<std::uint64_t>(
            std::max<std::int64_t>(flush_interval_ns(config.mode) / period_ns_, 1))),
        descriptor_(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)) {
    if (descriptor_ < 0) {
      throw std::system_error(errno, std::generic_category(), "cannot create the recording " + path.string());
    }
    mcap_.emplace([this](std::span<const std::byte> bytes) { write_all(bytes); },
                  McapWriterOptions{.profile = std::string(kRecordingProfile),
                                    .library = "drivebench " + std::string(build_id())});
    const std::string toml = to_toml(config);
    mcap_->add_attachment(kConfigurationAttachment, "application/toml", 0, bytes_of(toml));
    for (const RecordingAttachment& attachment : attachments)
      mcap_->add_attachment(attachment.name, attachment.media_type, 0, bytes_of(attachment.data));
    const std::string descriptors = bench_descriptor_set();
    const auto schema = [&](const char* name) {
      return mcap_->add_schema(name, "protobuf", bytes_of(descriptors));
    };
    const std::uint16_t sample = schema("drivebench.v1.Sample");
    inputs_ = mcap_->add_channel(kInputTopic, schema("drivebench.v1.Input"), "protobuf");
    verdict_ = mcap_->add_channel(kVerdictTopic, schema("drivebench.v1.Verdict"), "protobuf");
    for (const AxisConfig& axis : config.axes) {
      samples_.push_back(mcap_->add_channel(sample_topic(axis.name), sample, "protobuf"));
    }
    sequences_.resize(samples_.size());
  }
  ~File() { ::close(descriptor_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  void write(const SampleEntry& entry) {
    if (entry.axis == 0 && entry.sample.tick % flush_ticks_ == 0) mcap_->flush();
    ++unsaved_;
    const std::uint16_t channel = samples_[entry.axis];
    const auto room =
        mcap_->begin_message(header(channel, sequences_[entry.axis]++, entry.sample.tick), kMaxSampleBytes);
    mcap_->end_message(encode_sample(entry.sample, kAllSignals, room.data()));
  }

  void write(const InputEntry& entry) {
    ++unsaved_;
    encode_input(entry.received, entry.input, tables_, input_);
    add(inputs_, input_sequence_++, static_cast<std::uint64_t>(entry.received), input_);
  }

  void write(const Verdict& v) {
    ++unsaved_;
    v1::Verdict message;
    encode_verdict(v, message);
    add(verdict_, 0, v.ticks, message);
    mcap_->finish();
    if (::fsync(descriptor_) != 0) failed_ = true;
    if (failed_ && unsaved_ == 0) unsaved_ = 1;  // the end of the file, without which it does not replay
  }

  void sync() {
    if (::fdatasync(descriptor_) != 0) failed_ = true;
  }
  bool failed() const { return failed_; }

  /// Does something with the file that may run out of memory; that is a failure like that of a disk.
  template <class Action>
  void attempt(Action action) noexcept {
    try {
      action(*this);
    } catch (const std::exception&) {
      failed_ = true;
    }
  }

  /// Entries that were given to write() and will never reach the file; each is told once.
  std::uint64_t take_lost() { return failed_ ? std::exchange(unsaved_, 0) : 0; }

 private:
  McapMessageHeader header(std::uint16_t channel, std::uint32_t sequence, std::uint64_t tick) const {
    const std::uint64_t time_ns = tick * static_cast<std::uint64_t>(period_ns_);
    return {.channel = channel, .sequence = sequence, .log_time_ns = time_ns, .publish_time_ns = time_ns};
  }

  void add(std::uint16_t channel, std::uint32_t sequence, std::uint64_t tick,
           const google::protobuf::Message& message) {
    const std::size_t size = message.ByteSizeLong();
    const auto room = mcap_->begin_message(header(channel, sequence, tick), size);
    message.SerializeToArray(room.data(), static_cast<int>(size));
    mcap_->end_message(size);
  }

  void write_all(std::span<const std::byte> bytes) {
    std::span<const std::byte> rest = bytes;
    while (!rest.empty() && !failed_) {
      const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
      if (written > 0) {
        rest = rest.subspan(static_cast<std::size_t>(written));
      } else if (errno != EINTR) {
        failed_ = true;
      }
    }
    if (!failed_) {
      unsaved_ = 0;  // one call brings a whole chunk
      whole_bytes_ += static_cast<off_t>(bytes.size());
    } else if (::ftruncate(descriptor_, whole_bytes_) != 0) {
      return;  // the torn chunk stays; readers find its end missing
    }
  }

  ParameterTables tables_;
  std::int64_t period_ns_;
  std::uint64_t flush_ticks_;
  int descriptor_;
  bool failed_ = false;
  off_t whole_bytes_ = 0;  // of the file, up to the last chunk that was written whole
  std::uint64_t unsaved_ = 0;
  std::optional<McapWriter> mcap_;
  std::uint16_t inputs_ = 0;
  std::uint16_t verdict_ = 0;
  std::uint32_t input_sequence_ = 0;
  std::vector<std::uint16_t> samples_;
  std::vector<std::uint32_t> sequences_;
  v1::Input input_;
};

Recorder::Recorder(const std::filesystem::path& file, const BenchConfig& config,
                   std::initializer_list<RecordingAttachment> attachments)
    : file_(file.string()),
      ring_(ring_capacity(config)),
      room_for_tick_(config.axes.size() + 512),
      writer_(std::make_unique<File>(file, config, attachments)),
      thread_([this] { run(); }) {}

Recorder::~Recorder() {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
}

void Recorder::on_input(Tick now, const Input& input) noexcept {
  count_gap(!ring_.emplace(std::in_place_type<InputEntry>, now, input));
}

void Recorder::on_sample(std::uint32_t axis, const Sample& sample) noexcept {
  count_gap(!ring_.emplace(std::in_place_type<SampleEntry>, axis, sample));
}

void Recorder::count_gap(bool lost) noexcept {
  if (lost) gaps_.fetch_add(1, std::memory_order_relaxed);
}

void Recorder::wait_for_room() noexcept {
  while (ring_.room() < room_for_tick_)
    std::this_thread::sleep_for(std::chrono::microseconds(50));
}

bool Recorder::drain() noexcept {
  bool any = false;
  for (const Entry* entry = ring_.front(); entry != nullptr; entry = ring_.front()) {
    any = true;
    if (writer_->failed()) {
      gaps_.fetch_add(1, std::memory_order_relaxed);
    } else {
      writer_->attempt([&](File& file) { std::visit([&file](const auto& e) { file.write(e); }, *entry); });
    }
    ring_.pop();
  }
  count_lost();
  return any;
}

void Recorder::run() {
  auto last_sync = Clock::now();
  while (!stop_.load()) {
    if (!drain()) std::this_thread::sleep_for(kIdleSleep);
    const auto now = Clock::now();
    if (now - last_sync >= kSyncInterval) {
      writer_->sync();
      last_sync = now;
    }
  }
}

void Recorder::count_lost() {
  gaps_.fetch_add(writer_->take_lost(), std::memory_order_relaxed);
}

void Recorder::finish(const Verdict& verdict) {
  stop_.store(true);
  thread_.join();
  drain();
  Verdict final_verdict = verdict;
  final_verdict.gaps = gaps();
  writer_->write(final_verdict);
  count_lost();
}

}  // namespace drivebench
