#include "clients/command/control_compare.hpp"

#include <bench.pb.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <system_error>

#include "clients/command/control_axis.hpp"
#include "clients/command/control_presets.hpp"
#include "clients/command/control_run.hpp"
#include "clients/command/json.hpp"
#include "protocols/mapped_file.hpp"
#include "protocols/mcap.hpp"
#include "protocols/sample_codec.hpp"

namespace drivebench::command {
namespace {

constexpr std::array<std::string_view, 4> kTerminalNames = {"a", "b", "c", "field"};

/// What an answered sample said and what the answer was.
struct Answered {
  std::uint64_t tick;
  control::Measurement measurement;
  double angle_rad;
  v1::Gates gates;
  Terminals setpoint;
};

struct Recorded {
  std::string axis;
  double period_s = 0.0;
  std::vector<Answered> rows;
};

Terminals setpoint_of(const v1::Command& c) {
  if (c.gates() == v1::GATES_CURRENT) return {c.i_a_a(), c.i_b_a(), c.i_c_a(), c.i_f_a()};
  return {c.u_a_v(), c.u_b_v(), c.u_c_v(), c.u_f_v()};
}

/// Reads the samples of one axis and joins them with the commands that answered them.
class Reader {
 public:
  explicit Reader(std::string axis) : wanted_(std::move(axis)) {}

  void take(const McapReader& file, const McapMessage& message) {
    const std::string_view topic = file.channels().at(message.header.channel).topic;
    if (topic == "/inputs") {
      take_input(message);
    } else if (topic.ends_with("/sample")) {
      take_sample(topic.substr(1, topic.size() - 8), message);
    }
  }

  Recorded joined() const {
    Recorded out = {.axis = wanted_, .period_s = period_s_, .rows = {}};
    for (const v1::Command& command : commands_) {
      const auto sample = std::ranges::lower_bound(samples_, command.tick(), {}, &Sample::tick);
      if (sample == samples_.end() || sample->tick != command.tick()) continue;
      if (!out.rows.empty() && out.rows.back().tick >= command.tick()) continue;
      out.rows.push_back({.tick = command.tick(),
                          .measurement = measurement_of(*sample, kAllSignals),
                          .angle_rad = sample->angle_rad,
                          .gates = command.gates(),
                          .setpoint = setpoint_of(command)});
    }
    return out;
  }
  bool has_axis() const noexcept { return number_.has_value(); }
  const std::string& axes() const noexcept { return axes_; }

 private:
  void take_input(const McapMessage& message) {
    v1::Input input;
    if (!input.ParseFromArray(message.payload.data(), static_cast<int>(message.payload.size()))) return;
    if (input.action_case() == v1::Input::kCommand && input.axis() == number_) {
      commands_.push_back(input.command());
    }
  }
  void take_sample(std::string_view axis, const McapMessage& message) {
    const auto known = numbers_.find(std::string(axis));
    if (known == numbers_.end()) {
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
  }

  std::string wanted_;
  std::string axes_;
  std::map<std::string, std::uint32_t> numbers_;
  std::optional<std::uint32_t> number_;
  std::vector<Sample> samples_;
  std::vector<v1::Command> commands_;
  std::uint64_t last_ns_ = 0;
  double period_s_ = 0.0;
};

/// From where the run starts: the first command that asks for something, or the tick that was named.
Recorded read_run(const std::string& path, const std::string& axis, std::optional<std::uint64_t> from_tick) {
  Reader reader(axis);
  try {
    const MappedFile file(path);
    McapReader mcap(file.bytes());
    for (McapMessage message; mcap.next(message);)
      reader.take(mcap, message);
    if (mcap.problem() && mcap.problem()->kind == McapProblem::Kind::kNotMcap) {
      throw UsageError(fmt::format("{} is not a recording: {}", path, mcap.problem()->what));
    }
  } catch (const std::system_error& error) {
    throw UsageError(error.what());
  }
  if (!reader.has_axis()) {
    throw UsageError(fmt::format("no samples of axis '{}'; the recording has {}", axis, reader.axes()));
  }
  Recorded run = reader.joined();
  const auto start = std::ranges::find_if(run.rows, [&](const Answered& row) {
    if (from_tick) return row.tick >= *from_tick;
    return row.gates == v1::GATES_VOLTAGE || row.gates == v1::GATES_CURRENT;
  });
  run.rows.erase(run.rows.begin(), start);
  if (run.rows.empty()) throw UsageError(fmt::format("{} has no commands for axis {}", path, run.axis));
  return run;
}

void check_rate(const Recorded& recorded, const control::Run& run) {
  const double rate_hz = run.timing().sample_rate_hz;
  if (std::abs(recorded.period_s * rate_hz - 1.0) > 1e-6) {
    throw UsageError(fmt::format("the recording is sampled at {:g} Hz, the preset at {:g} Hz",
                                 1.0 / recorded.period_s, rate_hz));
  }
}

/// The reference controller answers the same samples.
void compare_commands(const Recorded& recorded, control::Run& run, Comparison& out) {
  out.terminals.clear();
  for (const std::string_view name : kTerminalNames)
    out.terminals.emplace_back(name, Difference());
  std::uint64_t last_tick = recorded.rows.front().tick;
  const double start_rad = recorded.rows.front().angle_rad;
  for (const Answered& row : recorded.rows) {
    const auto periods = std::max<std::int64_t>(1, static_cast<std::int64_t>(row.tick - last_tick));
    last_tick = row.tick;
    const Terminals reference = terminals_of(run.step(row.measurement, periods));
    if (run.done()) break;
    ++out.samples;
    // Gates off or shorted ask for nothing, whatever numbers stand beside it.
    const bool asks = row.gates == v1::GATES_VOLTAGE || row.gates == v1::GATES_CURRENT;
    for (std::size_t i = 0; i < reference.size(); ++i) {
      const double difference = (asks ? row.setpoint[i] : 0.0) - reference[i];
      out.commands.add(row.tick, difference, out.threshold);
      out.terminals[i].second.add(row.tick, difference, out.threshold);
    }
    out.final_error_rad = run.reference().angle_rad - (row.angle_rad - start_rad);
    out.tracking_rad.add(row.tick, out.final_error_rad, HUGE_VAL);
  }
  out.whole = run.done() || out.samples == run.planned_samples();
}

/// Sample by sample at the same time after the start.
void compare_runs(const Recorded& recorded, const Recorded& other, std::int64_t samples, Comparison& out) {
  const Answered& first = recorded.rows.front();
  const Answered& first_there = other.rows.front();
  auto there = other.rows.begin();
  for (const Answered& row : recorded.rows) {
    if (samples-- <= 0) return;
    const std::uint64_t after = row.tick - first.tick;
    while (there != other.rows.end() && there->tick - first_there.tick < after)
      ++there;
    if (there == other.rows.end()) return;
    if (there->tick - first_there.tick != after) continue;
    for (std::size_t i = 0; i < row.setpoint.size(); ++i)
      out.other_commands.add(row.tick, row.setpoint[i] - there->setpoint[i], out.threshold);
    out.other_angle_rad.add(
        row.tick, (row.angle_rad - first.angle_rad) - (there->angle_rad - first_there.angle_rad), 0.0);
  }
}

void print_difference(std::string_view name, const Difference& d, std::string_view unit) {
  fmt::print("  {:<32} largest {:.4g} {} at tick {}, rms {:.4g}{}\n", name, d.largest, unit, d.largest_tick,
             d.rms(), d.first_tick_beyond ? fmt::format(", first at tick {}", *d.first_tick_beyond) : "");
}

void print_comparison(const Comparison& c) {
  fmt::print("{} on axis {}, {} samples from tick {} on, against {}{}\n", c.recording, c.axis, c.samples,
             c.first_tick, c.preset, c.whole ? "" : " (the recording ends before the run does)");
  print_difference("command - reference controller's", c.commands, c.unit);
  for (const auto& [name, difference] : c.terminals) {
    if (difference.largest > 0.0) print_difference("  terminal " + name, difference, c.unit);
  }
  print_difference("trajectory - recorded angle", c.tracking_rad, "rad");
  if (c.counts_per_rad > 0.0) {
    fmt::print("  {:<32} peak {:.2f} counts, at the end {:.2f} counts\n", "",
               c.tracking_rad.largest * c.counts_per_rad, c.final_error_rad * c.counts_per_rad);
  }
  if (c.other.empty()) return;
  fmt::print("and {}\n", c.other);
  print_difference("command - command there", c.other_commands, c.unit);
  print_difference("angle - angle there", c.other_angle_rad, "rad");
}

}  // namespace

void Difference::add(std::uint64_t tick, double difference, double threshold) noexcept {
  const double magnitude = std::abs(difference);
  sum_of_squares += difference * difference;
  ++count;
  if (!first_tick_beyond && !(magnitude <= threshold)) first_tick_beyond = tick;
  if (count == 1 || magnitude > largest) {
    largest = magnitude;
    largest_tick = tick;
  }
}

double Difference::rms() const noexcept {
  return count == 0 ? 0.0 : std::sqrt(sum_of_squares / static_cast<double>(count));
}

int run_compare(const CompareOptions& options) {
  const control::Preset& preset = chosen_preset(options.preset);
  control::Run run = made(preset, options.overrides);
  const Recorded recorded = read_run(options.recording, options.axis, options.from_tick);
  check_rate(recorded, run);
  Comparison out;
  out.recording = options.recording;
  out.axis = recorded.axis;
  out.preset = preset.name;
  out.unit = run.controller().quantity() == control::Quantity::kVoltage ? "V" : "A";
  out.threshold = options.threshold.value_or(0.0);
  out.first_tick = recorded.rows.front().tick;
  out.counts_per_rad = needs_of(preset, options.overrides).counts_per_revolution / (2.0 * std::numbers::pi);
  compare_commands(recorded, run, out);
  if (!options.other.empty()) {
    out.other = options.other;
    compare_runs(recorded, read_run(options.other, options.axis, std::nullopt), out.samples, out);
  }
  if (options.json) {
    fmt::print("{}\n", comparison_json(out));
  } else {
    print_comparison(out);
  }
  return options.threshold && out.commands.first_tick_beyond ? kExitFailed : kExitOk;
}

}  // namespace drivebench::command
