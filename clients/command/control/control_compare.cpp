#include "clients/command/control/control_compare.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/control/control_json.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/command/control/control_replay.hpp"
#include "clients/command/control/control_run.hpp"
#include "clients/command/recording/recorded_run.hpp"
#include "clients/link/common/requests.hpp"
#include "clients/reference/preset_fit.hpp"

namespace drivebench::command {
namespace {

constexpr std::array<std::string_view, 4> kTerminalNames = {"a", "b", "c", "field"};

TerminalValues asked_for(const v1::Command& c) {
  if (!asks_for_something(c)) return {};
  const link::Setpoints x = link::setpoints_of(c);
  return {x.a, x.b, x.c, x.f};
}

/// The reference controller answers the same samples.
void compare_commands(const RecordedRun& recorded, control::Run& run, Comparison& out) {
  out.terminals.clear();
  for (const std::string_view name : kTerminalNames)
    out.terminals.emplace_back(name, Difference());
  const double start_rad = recorded.rows.front().sample.angle_rad;
  answer_recorded(recorded, run, [&](const Answered& row, const control::Setpoint& setpoint) {
    const std::uint64_t tick = row.sample.tick;
    if (row.command.gates() == v1::GATES_DUTY) {
      throw UsageError(
          fmt::format("the recording commands duties at tick {}, but the reference controller commands "
                      "voltages or currents",
                      tick));
    }
    ++out.samples;
    const TerminalValues reference = reference::terminal_values_of(setpoint);
    const TerminalValues there = asked_for(row.command);
    for (std::size_t i = 0; i < reference.size(); ++i) {
      const double difference = there[i] - reference[i];
      out.commands.add(tick, difference, out.threshold);
      out.terminals[i].second.add(tick, difference, out.threshold);
    }
    out.final_error_rad = run.reference().angle_rad - (row.sample.angle_rad - start_rad);
    out.tracking_rad.add(tick, out.final_error_rad, HUGE_VAL);
  });
  // A controller may have missed samples on the way to the end; a damaged file may hide them.
  out.whole = (run.done() && recorded.is_whole) || out.samples == run.planned_samples();
}

/// Sample by sample at the same time after the start.
void compare_runs(const RecordedRun& recorded, const RecordedRun& other, std::int64_t samples,
                  Comparison& out) {
  const Sample& first = recorded.rows.front().sample;
  const Sample& first_there = other.rows.front().sample;
  auto there = other.rows.begin();
  for (const Answered& row : recorded.rows) {
    if (samples-- <= 0) return;
    const std::uint64_t tick = row.sample.tick;
    while (there != other.rows.end() && there->sample.tick - first_there.tick < tick - first.tick)
      ++there;
    if (there == other.rows.end()) return;
    if (there->sample.tick - first_there.tick != tick - first.tick) continue;
    const TerminalValues asked = asked_for(row.command);
    const TerminalValues asked_there = asked_for(there->command);
    for (std::size_t i = 0; i < asked.size(); ++i)
      out.other_commands.add(tick, asked[i] - asked_there[i], out.threshold);
    const double turned_rad = row.sample.angle_rad - first.angle_rad;
    const double turned_there_rad = there->sample.angle_rad - first_there.angle_rad;
    out.other_angle_rad.add(tick, turned_rad - turned_there_rad, 0.0);
  }
}

void print_difference(std::string_view name, const Difference& d, std::string_view unit) {
  fmt::print("  {:<32} largest {:.4g} {} at tick {}, rms {:.4g}{}\n", name, d.largest, unit, d.largest_tick,
             d.rms(), d.first_tick_beyond ? fmt::format(", first at tick {}", *d.first_tick_beyond) : "");
}

void print_comparison(const Comparison& c) {
  fmt::print("{} on axis {}, {} samples from tick {} on, against {}{}\n", c.recording, c.axis, c.samples,
             c.first_tick, c.preset, c.whole ? "" : " (the recording does not hold the whole run)");
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
  const RecordedRun recorded = read_run(options.recording, options.axis, options.from_tick);
  Comparison out;
  out.recording = options.recording;
  out.axis = recorded.axis;
  out.preset = preset.name;
  out.unit = run.controller().quantity() == control::Quantity::kVoltage ? "V" : "A";
  out.threshold = options.threshold.value_or(0.0);
  out.first_tick = recorded.rows.front().sample.tick;
  out.counts_per_rad =
      reference::needs_of(preset, options.overrides).counts_per_revolution / (2.0 * std::numbers::pi);
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
  const bool is_judged = options.threshold.has_value();
  return is_judged && (out.commands.first_tick_beyond || !out.whole) ? kExitFailed : kExitOk;
}

}  // namespace drivebench::command
