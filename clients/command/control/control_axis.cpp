#include "clients/command/control/control_axis.hpp"

#include <fmt/core.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/tcp_axis.hpp"

namespace drivebench::command {
namespace {

constexpr double kStill_rad_s = 1.0;  // holding a position against the steps of the encoder leaves 0.2

std::optional<double> parameter(const v1::AxisDescription& axis, std::string_view name) {
  for (const v1::ParameterDescription& row : axis.parameters()) {
    if (row.name() == name) return row.value();
  }
  return std::nullopt;
}

bool differ(double a, double b) noexcept {
  return std::abs(a - b) > 1e-9 * std::abs(b);
}

/// Whether the bench obeys the commands: an axis that is idle or ready has too few of them.
bool is_armed(const link::AxisLink& bench, const Sample& sample) {
  constexpr std::uint64_t kIdle = 0;
  constexpr std::uint64_t kReady = 5;
  return !bench.knows("state") || (sample.state != kIdle && sample.state != kReady);
}

/// Gates off for so long, and until the axis is armed; the speed at the end, the mean one of the second half
/// if the link does not carry it.
double speed_after_rest(link::AxisLink& bench, double duration_s, double counts_per_revolution) {
  const Sample start = bench.newest();
  const double rest_ticks = duration_s / bench.bench().period_s();
  Sample half_way = start;
  Sample sample = start;
  while (static_cast<double>(sample.tick - start.tick) < rest_ticks || !is_armed(bench, sample)) {
    if (interrupted()) break;
    if (static_cast<double>(sample.tick - start.tick) < rest_ticks / 2) half_way = sample;
    sample = bench.exchange({.tick = sample.tick, .gates = v1::GATES_OFF});
  }
  if (bench.knows("speed_rad_s")) return sample.speed_rad_s;
  if (counts_per_revolution <= 0.0) return 0.0;
  // A count within the second half of 50 ms is 0.13 rad/s.
  const double turned_rad = static_cast<double>(sample.encoder_count - half_way.encoder_count) *
                            (2.0 * std::numbers::pi / counts_per_revolution);
  return turned_rad / (static_cast<double>(sample.tick - half_way.tick) * bench.bench().period_s());
}

/// The second motor that the preset drives is that of the axis on the same amplifier.
void add_mismatches_of_second(const v1::BenchDescription& bench, std::uint32_t axis,
                              const control::Requirements& needs, std::vector<std::string>& found) {
  const std::optional<std::uint32_t> number = link::sharer_of_amplifier(bench, axis);
  if (!number) {
    found.emplace_back(
        "the preset drives two motors, but this link shows no axis that shares the amplifier of this one");
    return;
  }
  const v1::AxisDescription& second = bench.axes(static_cast<int>(*number));
  const auto must_equal = [&](std::string_view name, double expected) {
    const std::optional<double> value = parameter(second, name);
    if (!value || !differ(*value, expected)) return;
    found.push_back(fmt::format("{} of axis {} is {:g} on the bench, {:g} in the preset", name, second.name(),
                                *value, expected));
  };
  if (second.machine_kind() != needs.machine_kind) {
    found.push_back(fmt::format("machine.kind of axis {} is {} on the bench, {} in the preset", second.name(),
                                second.machine_kind(), needs.machine_kind));
  }
  must_equal("encoder.counts_per_revolution", needs.counts_per_revolution);
  must_equal("machine.pole_pairs", needs.pole_pairs);
}

}  // namespace

control::Requirements needs_of(const control::Preset& preset, std::span<const control::Gain> overrides) {
  control::Requirements needs = preset.needs;
  for (const control::Gain& gain : overrides) {
    if (gain.name == "counts_per_revolution") needs.counts_per_revolution = gain.value;
    if (gain.name == "machine.pole_pairs") needs.pole_pairs = gain.value;
    if (gain.name == "voltage_limit_v") needs.voltage_limit_v = gain.value;
  }
  return needs;
}

std::vector<std::string> mismatches(const v1::BenchDescription& bench, std::uint32_t axis,
                                    const control::Requirements& needs, double sample_rate_hz,
                                    SignalMask known) {
  std::vector<std::string> found;
  const v1::AxisDescription& there = bench.axes(static_cast<int>(axis));
  const auto must_equal = [&](std::string_view what, std::optional<double> value, double expected) {
    if (value && differ(*value, expected)) {
      found.push_back(fmt::format("{} is {:g} on the bench, {:g} in the preset", what, *value, expected));
    }
  };
  // Links without a description leave the kinds empty.
  const std::string& kind = there.machine_kind();
  if (!kind.empty() && kind != needs.machine_kind && kind != needs.other_kind) {
    found.push_back(
        fmt::format("machine.kind is {} on the bench, {} in the preset", kind, needs.machine_kind));
  }
  const bool wants_currents = needs.quantity == control::Quantity::kCurrent;
  const std::string& drive = there.drive_kind();
  if (!drive.empty() && (drive == "source" || wants_currents != (drive == "current_amplifier"))) {
    found.push_back(fmt::format("drive.kind is {} on the bench, the preset commands {}", drive,
                                wants_currents ? "currents" : "voltages"));
  }
  const Signal* const signal = find_signal(needs.signal);
  if (signal != nullptr && (known >> (signal - kSignals.data()) & 1) == 0) {
    found.push_back(fmt::format("the preset measures {}, which this link does not carry", needs.signal));
  }
  must_equal("the sample rate [Hz]", 1.0 / bench.period_s(), sample_rate_hz);
  if (needs.counts_per_revolution > 0.0) {
    must_equal("encoder.counts_per_revolution", parameter(there, "encoder.counts_per_revolution"),
               needs.counts_per_revolution);
  }
  if (needs.pole_pairs > 0.0) {
    must_equal("machine.pole_pairs", parameter(there, "machine.pole_pairs"), needs.pole_pairs);
  }
  const std::optional<double> limit_v = parameter(there, "amplifier.voltage_limit_v");
  if (limit_v && *limit_v < needs.voltage_limit_v) {
    found.push_back(fmt::format("amplifier.voltage_limit_v is {:g} on the bench, the preset uses up to {:g}",
                                *limit_v, needs.voltage_limit_v));
  }
  if (needs.drives_second) add_mismatches_of_second(bench, axis, needs, found);
  return found;
}

double counts_per_revolution(const v1::BenchDescription& bench, std::uint32_t axis,
                             const control::Requirements& needs) {
  return parameter(bench.axes(static_cast<int>(axis)), "encoder.counts_per_revolution")
      .value_or(needs.counts_per_revolution);
}

void let_rest(link::AxisLink& bench, double counts_per_revolution) {
  constexpr double kRest_s = 0.050;
  constexpr int kMostRests = 100;
  if (bench.newest().tick == 0 && bench.bench().arming_commands() <= 1) return;
  double speed_rad_s = 0.0;
  for (int rest = 0; rest < kMostRests && !interrupted(); ++rest) {
    speed_rad_s = speed_after_rest(bench, kRest_s, counts_per_revolution);
    if (bench.second() != nullptr && std::abs(bench.second()->speed_rad_s) > std::abs(speed_rad_s)) {
      speed_rad_s = bench.second()->speed_rad_s;
    }
    if (std::abs(speed_rad_s) <= kStill_rad_s) return;
  }
  throw UsageError(fmt::format("the shaft turns at {:.3g} rad/s; the run starts from rest", speed_rad_s));
}

}  // namespace drivebench::command
