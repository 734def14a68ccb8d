#include "clients/command/recording/recorded_run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <string_view>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/recording/recorded_configuration.hpp"
#include "clients/command/recording/recording_file.hpp"
#include "clients/command/recording/wall_time.hpp"
#include "protocols/sample_codec.hpp"

namespace drivebench::command {
namespace {

/// Reads the samples of one axis and joins them with the commands that answered them.
class Reader {
 public:
  Reader(std::string axis, const Epoch& epoch)
      : wanted_(std::move(axis)), is_real_time_(epoch.has_value()), wall_time_(epoch) {}

  void take(const McapReader& file, const McapMessage& message) {
    const std::string_view topic = file.channels().at(message.header.channel).topic;
    if (topic == "/inputs") {
      take_input(message);
    } else if (const std::string_view axis = axis_of(topic); !axis.empty()) {
      take_sample(axis, file, message);
    }
  }

  RecordedRun joined() const {
    RecordedRun out = empty_run();
    for (const v1::Command& command : commands_) {
      const auto sample = std::ranges::lower_bound(samples_, command.tick(), {}, &Sample::tick);
      if (sample == samples_.end() || sample->tick != command.tick()) continue;
      if (!out.rows.empty() && out.rows.back().sample.tick >= command.tick()) continue;
      out.rows.push_back({.sample = *sample,
                          .command = command,
                          .due_unix_ns = due_unix_ns_[static_cast<std::size_t>(sample - samples_.begin())]});
    }
    return out;
  }
  RecordedRun all() const {
    RecordedRun out = empty_run();
    out.rows.reserve(samples_.size());
    auto command = commands_.begin();
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const Sample& sample = samples_[i];
      while (command != commands_.end() && command->tick() < sample.tick)
        ++command;
      const bool answered = command != commands_.end() && command->tick() == sample.tick;
      out.rows.push_back(
          {.sample = sample, .command = answered ? *command : v1::Command(), .due_unix_ns = due_unix_ns_[i]});
    }
    return out;
  }
  std::vector<Sample> take_samples() noexcept { return std::move(samples_); }
  bool has_axis() const noexcept { return number_.has_value(); }
  const std::string& axes() const noexcept { return axes_; }

 private:
  RecordedRun empty_run() const {
    return {.axis = wanted_, .period_s = period_s_, .rows = {}, .is_real_time = is_real_time_};
  }
  void take_input(const McapMessage& message) {
    v1::Input input;
    if (!input.ParseFromArray(message.payload.data(), static_cast<int>(message.payload.size()))) return;
    if (input.action_case() == v1::Input::kCommand && input.axis() == number_) {
      commands_.push_back(input.command());
    }
  }
  void take_sample(std::string_view axis, const McapReader& file, const McapMessage& message) {
    if (!numbers_.contains(axis)) {
      // A tick brings the samples of all axes, in their order.
      const auto number = static_cast<std::uint32_t>(numbers_.size());
      numbers_.emplace(axis, number);
      axes_ += fmt::format("{}{}", axes_.empty() ? "" : ", ", axis);
      if (wanted_.empty() || wanted_ == "0") wanted_ = axis;
      if (wanted_ == axis) number_ = number;
    }
    if (axis != wanted_) return;
    const std::optional<Sample> sample = decode_sample(message.payload);
    if (!sample) return;
    if (!samples_.empty() && sample->tick > samples_.back().tick) {
      period_s_ = static_cast<double>(message.header.log_time_ns - last_ns_) * 1e-9 /
                  static_cast<double>(sample->tick - samples_.back().tick);
    }
    last_ns_ = message.header.log_time_ns;
    samples_.push_back(*sample);
    due_unix_ns_.push_back(wall_time_.unix_ns_of(file, message.header.log_time_ns));
  }

  std::string wanted_;
  bool is_real_time_;
  WallTime wall_time_;
  std::string axes_;
  std::map<std::string, std::uint32_t, std::less<>> numbers_;
  std::optional<std::uint32_t> number_;
  std::vector<Sample> samples_;
  std::vector<std::int64_t> due_unix_ns_;  // of the samples
  std::vector<v1::Command> commands_;
  std::uint64_t last_ns_ = 0;
  double period_s_ = 0.0;
};

}  // namespace

bool asks_for_something(const v1::Command& command) noexcept {
  return command.gates() == v1::GATES_VOLTAGE || command.gates() == v1::GATES_CURRENT ||
         command.gates() == v1::GATES_DUTY || command.gates() == v1::GATES_EDGES;
}

namespace {

void take_all(McapSeries& mcap, Reader& reader) {
  for (McapMessage message; mcap.next(message);)
    reader.take(mcap.reader(), message);
}

/// The name of the axis that shares the amplifier of this one; empty: none does.
std::string second_of(const McapReader& file, const std::string& axis) {
  const std::optional<ConfigNode> configuration = recorded_configuration(file);
  const ConfigNode* const axes = configuration ? child_of(*configuration, "axis") : nullptr;
  if (axes == nullptr) return {};
  for (const ConfigNode& node : axes->children) {
    if (text_of(node, "shares_amplifier_with") == axis) return text_of(node, "name");
  }
  return {};
}

RecordedRun read(const std::string& path, const std::string& axis, bool all) {
  const MappedSeries files = open_recording(path);
  const Epoch epoch = epoch_of(files);
  Reader reader(axis, epoch);
  McapSeries mcap(files.segments());
  take_all(mcap, reader);
  refuse_other_files(mcap, path);
  if (mcap.problem()) fmt::print(stderr, "drivebench: {} is not whole: {}\n", path, mcap.problem()->what);
  if (!reader.has_axis()) {
    throw UsageError(fmt::format("no samples of axis '{}'; the recording has {}", axis,
                                 reader.axes().empty() ? "none" : reader.axes()));
  }
  RecordedRun run = all ? reader.all() : reader.joined();
  run.is_whole = !mcap.problem();
  if (const std::string second = second_of(mcap.reader(), run.axis); !second.empty()) {
    Reader other(second, epoch);
    McapSeries again(files.segments());
    take_all(again, other);
    run.second = other.take_samples();
  }
  return run;
}

}  // namespace

const Sample* RecordedRun::second_at(std::uint64_t tick) const noexcept {
  const auto found = std::ranges::lower_bound(second, tick, {}, &Sample::tick);
  return found != second.end() && found->tick == tick ? &*found : nullptr;
}

RecordedRun read_run(const std::string& path, const std::string& axis,
                     std::optional<std::uint64_t> from_tick) {
  RecordedRun run = read(path, axis, false);
  const auto start = std::ranges::find_if(run.rows, [&](const Answered& row) {
    return from_tick ? row.sample.tick >= *from_tick : asks_for_something(row.command);
  });
  run.rows.erase(run.rows.begin(), start);
  if (run.rows.empty()) throw UsageError(fmt::format("{} has no commands for axis {}", path, run.axis));
  return run;
}

RecordedRun read_samples(const std::string& path, const std::string& axis,
                         std::optional<std::uint64_t> from_tick) {
  RecordedRun run = read(path, axis, true);
  const auto start = std::ranges::find_if(run.rows, [&](const Answered& row) {
    return from_tick ? row.sample.tick >= *from_tick : asks_for_something(row.command);
  });
  if (from_tick || start != run.rows.end()) run.rows.erase(run.rows.begin(), start);
  if (run.rows.empty())
    throw UsageError(
        fmt::format("{} has no samples of axis {} from tick {} on", path, run.axis, from_tick.value_or(0)));
  return run;
}

}  // namespace drivebench::command
