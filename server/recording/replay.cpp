#include "server/recording/replay.hpp"

#include <fmt/core.h>

#include <bit>
#include <map>
#include <stdexcept>

#include "bench.pb.h"
#include "protocols/mcap/mcap_series.hpp"
#include "protocols/sample_codec.hpp"
#include "server/bench/bench.hpp"
#include "server/config/config.hpp"
#include "server/host/build_id.hpp"
#include "server/recording/input_codec.hpp"
#include "server/recording/recording.hpp"

namespace drivebench {
namespace {

std::string text_of(const Signal& signal, const Sample& sample) {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return fmt::format("{}", sample.*signal.as_unsigned);
    case SignalType::kSigned:
      return fmt::format("{}", sample.*signal.as_signed);
    case SignalType::kReal:
      break;
  }
  return fmt::format("{:.17g}", sample.*signal.as_real);
}

bool same_bits(const Signal& signal, const Sample& a, const Sample& b) noexcept {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return a.*signal.as_unsigned == b.*signal.as_unsigned;
    case SignalType::kSigned:
      return a.*signal.as_signed == b.*signal.as_signed;
    case SignalType::kReal:
      break;
  }
  return std::bit_cast<std::uint64_t>(a.*signal.as_real) == std::bit_cast<std::uint64_t>(b.*signal.as_real);
}

/// Replays one recording. Each step returns false to end the replay.
class Replayer {
 public:
  explicit Replayer(const std::vector<std::span<const std::byte>>& segments) : series_(segments) {
    for (const std::span<const std::byte> segment : segments)
      bytes_ += segment.size();
  }

  /// Replays on this bench, in the place of one of its own, and ends with this tick.
  Replayer(const std::vector<std::span<const std::byte>>& segments, Bench& bench, const Repetition& what)
      : Replayer(segments) {
    bench_ = &bench;
    what_ = &what;
  }

  ReplayReport run(void (*on_progress)(double)) {
    bool more = true;
    for (McapMessage message; more && series_.next(message);) {
      if (series_.problem()) {
        unusable(series_.problem()->what);  // in an earlier file: what follows it has no beginning
        break;
      }
      if (axes_.empty() && !build_bench()) break;
      if (!report_.begun_unix_ns && !read_epoch()) break;
      const std::string_view topic = reader().channels().at(message.header.channel).topic;
      if (has_verdict_) {
        more = unusable("something follows its verdict");
      } else if (topic == kInputTopic) {
        more = feed(message.header, message.payload);
      } else if (topic == kVerdictTopic) {
        more = judge(message.payload);
      } else if (const auto axis = axes_.find(topic); axis != axes_.end()) {
        more = compare(axis->second, message.payload);
      }
      seen_ += message.payload.size() + kMessageRecordBytes;
      if ((++messages_ & 0xffff) == 0 && on_progress != nullptr) {
        on_progress(static_cast<double>(seen_) / static_cast<double>(bytes_));
      }
    }
    conclude();
    if (!report_.problem.empty() && bench_ != nullptr && !report_.same_build) {
      report_.problem +=
          fmt::format("; it was recorded by {}, this is {}", report_.recorded_by, recorder_name());
    }
    return std::move(report_);
  }

 private:
  bool build_bench() {
    report_.recorded_by = reader().library();
    report_.same_build = report_.recorded_by == recorder_name();
    if (series_.first_number() != 1) {
      return unusable(
          fmt::format("it is file {} of a recording; the first one is needed", series_.first_number()));
    }
    for (const McapAttachment& attachment : reader().attachments()) {
      if (attachment.name != kConfigurationAttachment) continue;
      try {
        const std::string_view text(reinterpret_cast<const char*>(attachment.data.data()),
                                    attachment.data.size());
        config_ = parse_config(text, std::string(kConfigurationAttachment), {});
      } catch (const ConfigError& error) {
        return unusable(fmt::format("its configuration cannot be read: {}", error.what()));
      }
      tables_ = parameter_tables(config_.setup);
      own_bench_.emplace(config_.setup);
      if (what_ != nullptr && own_bench_->setup_hash() != bench_->setup_hash())
        return different("the bench is not the one of the recording");
      if (what_ == nullptr) bench_ = &*own_bench_;
      for (std::size_t i = 0; i < config_.axes.size(); ++i)
        axes_[sample_topic(config_.axes[i].name)] = i;
      return true;
    }
    return unusable("it has no configuration inside (attachment bench.toml)");
  }

  /// Later time bases, after standstills, do not change when the run began.
  bool read_epoch() {
    if (reader().metadata().size() == metadata_seen_) return true;
    metadata_seen_ = reader().metadata().size();
    try {
      if (const auto base = time_base_at(reader())) report_.begun_unix_ns = base->epoch_unix_ns;
      return true;
    } catch (const std::runtime_error& error) {
      return unusable(error.what());
    }
  }

  bool unusable(std::string why) {
    report_.result = ReplayReport::Result::kUnusable;
    report_.problem = std::move(why);
    stopped_ = true;
    return false;
  }

  bool different(std::string why) {
    report_.result = ReplayReport::Result::kDifferent;
    report_.problem = std::move(why);
    stopped_ = true;
    return false;
  }

  /// As after a kill or on a full disk; the part in the file is equal.
  void end_early(const std::string& why) {
    report_.result = ReplayReport::Result::kEqualWithoutEnd;
    report_.ticks = report_.samples / config_.axes.size() - 1;
    report_.problem = "the recording has no end: " + why;
  }

  /// The reason for which the input cannot have come here; empty: it can.
  std::string problem_of_place(const McapMessageHeader& header, const v1::Input& message,
                               const Input& input) const {
    const Tick now = bench_->tick();
    const std::uint64_t received = message.received_tick();
    if (received > static_cast<std::uint64_t>(now)) {
      return fmt::format("samples between tick {} and an input of tick {} are missing", now, received);
    }
    const std::string which = fmt::format("it is damaged: an input among those of tick {} ", now);
    if (received < static_cast<std::uint64_t>(now)) return which + fmt::format("came at tick {}", received);
    if (header.log_time_ns != received * static_cast<std::uint64_t>(config_.setup.period_ns)) {
      return which + fmt::format("has the time {} ns", header.log_time_ns);
    }
    const std::uint64_t latest = may_be_scheduled(input.action) ? kMaxTick : received;
    if (message.tick() < received || message.tick() > latest) {
      return which + fmt::format("says that it acts at tick {}", message.tick());
    }
    return {};
  }

  bool feed(const McapMessageHeader& header, std::span<const std::byte> payload) {
    v1::Input message;
    std::optional<Input> input;
    if (message.ParseFromArray(payload.data(), static_cast<int>(payload.size())))
      input = decode_input(message, tables_);
    if (!input) return unusable(fmt::format("an input at tick {} cannot be read", bench_->tick()));
    const std::string problem = problem_of_place(header, message, *input);
    if (!problem.empty()) return unusable(problem);
    bench_->repeat(*input);
    ++report_.inputs;
    return true;
  }

  bool compare(std::size_t axis, std::span<const std::byte> payload) {
    const std::optional<Sample> recorded = decode_sample(payload);
    if (!recorded) return unusable(fmt::format("a sample after tick {} cannot be read", bench_->tick()));
    const auto tick = static_cast<Tick>(recorded->tick);
    // The samples of a tick come in the order of the axes: a missing or doubled one breaks the order.
    const bool next_tick = axis == 0 && report_.samples > 0;
    const Tick expected = bench_->tick() + (next_tick ? 1 : 0);
    if (axis != report_.samples % config_.axes.size() || tick != expected) {
      return different(fmt::format("after {} samples, up to tick {}, follows one of {} at tick {}",
                                   report_.samples, bench_->tick(), config_.axes[axis].name, tick));
    }
    if (next_tick) step();
    ++report_.samples;
    const Sample& replayed = bench_->sample(axis);
    for (const Signal& signal : kSignals) {
      if (same_bits(signal, *recorded, replayed)) continue;
      report_.difference = ReplayDifference{.tick = recorded->tick,
                                            .axis = config_.axes[axis].name,
                                            .signal = std::string(signal.name),
                                            .recorded = text_of(signal, *recorded),
                                            .replayed = text_of(signal, replayed)};
      return different(fmt::format("tick {}: {}.{} was recorded as {} and replays as {}", tick,
                                   report_.difference->axis, signal.name, report_.difference->recorded,
                                   report_.difference->replayed));
    }
    if (what_ == nullptr || tick < what_->until || axis + 1 != config_.axes.size()) return true;
    report_.result = ReplayReport::Result::kEqual;
    stopped_ = true;
    return false;
  }

  void step() {
    if (what_ != nullptr) what_->before_tick();
    bench_->step();
  }

  bool judge(std::span<const std::byte> payload) {
    if (!verdict_.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
      return unusable("its verdict cannot be read");
    }
    has_verdict_ = true;
    if (verdict_.gaps() > 0)
      return unusable(fmt::format("it lost {} entries while recording", verdict_.gaps()));
    return true;
  }

  void conclude() {
    if (bench_ != nullptr) {
      report_.ticks = static_cast<std::uint64_t>(bench_->tick());
      report_.state_hash = bench_->state_hash();
    }
    if (stopped_) return;
    const McapProblem* const problem = series_.problem() ? &*series_.problem() : nullptr;
    if (problem != nullptr && problem->kind != McapProblem::Kind::kTruncated) {
      unusable(problem->what);
    } else if (axes_.empty() || report_.samples < config_.axes.size()) {
      unusable(problem != nullptr ? problem->what : "it holds no samples");
    } else if (!has_verdict_) {
      end_early(problem != nullptr ? problem->what : "it holds no verdict");
    } else if (verdict_.ticks() != report_.ticks ||
               report_.samples != (report_.ticks + 1) * config_.axes.size()) {
      different(fmt::format("its verdict speaks of {} ticks but there are {} samples of {} ticks",
                            verdict_.ticks(), report_.samples, report_.ticks));
    } else if (verdict_.state_hash() != report_.state_hash) {
      different(fmt::format("all samples are equal but the state hash was {:016x} and replays as {:016x}",
                            verdict_.state_hash(), report_.state_hash));
    } else if (problem != nullptr) {
      end_early(problem->what);
    } else {
      report_.result = ReplayReport::Result::kEqual;
    }
  }

  static constexpr std::uint64_t kMessageRecordBytes = 31;  // around a payload, for the progress only

  const McapReader& reader() const { return series_.reader(); }

  McapSeries series_;
  std::uint64_t bytes_ = 0;
  std::uint64_t seen_ = 0;
  BenchConfig config_;
  ParameterTables tables_;
  std::optional<Bench> own_bench_;
  Bench* bench_ = nullptr;
  const Repetition* what_ = nullptr;  ///< null: the whole recording
  std::map<std::string, std::size_t, std::less<>> axes_;
  v1::Verdict verdict_;
  ReplayReport report_;
  std::uint64_t messages_ = 0;
  std::size_t metadata_seen_ = 0;
  bool has_verdict_ = false;
  bool stopped_ = false;
};

}  // namespace

ReplayReport replay(std::span<const std::byte> recording, void (*on_progress)(double)) {
  return Replayer({recording}).run(on_progress);
}

ReplayReport replay(const std::vector<std::span<const std::byte>>& segments, void (*on_progress)(double)) {
  return Replayer(segments).run(on_progress);
}

void repeat(const std::vector<std::span<const std::byte>>& segments, Bench& bench, const Repetition& what) {
  bench.only_watch_triggers(true);
  const ReplayReport report = Replayer(segments, bench, what).run(nullptr);
  bench.only_watch_triggers(false);
  using enum ReplayReport::Result;
  if (report.result == kDifferent || report.result == kUnusable) throw std::runtime_error(report.problem);
  if (bench.tick() < what.until)
    throw std::runtime_error(fmt::format("it ends at tick {}, before tick {}", bench.tick(), what.until));
}

}  // namespace drivebench
