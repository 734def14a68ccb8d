// Changes of a running axis: parameters, at once or on a ramp, injected faults, and multisines. Those of a
// drive are for the axis that owns it.
#include <cmath>
#include <span>

#include "plant/parameters/drive_rows.hpp"
#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kCurrentOffsetRow = find_injectable_fault("current_sensor_offset");

bool breaks_a_shared_rule(const DriveParameters& p) noexcept {
  Problems found;
  add_shared_problems(p, found);
  return found.any();
}

}  // namespace

Refused Bench::check_shared(const Input& input) const noexcept {
  if (!takes_voltages(input.axis)) return Refused::kNot;
  if (const auto* write = std::get_if<ParameterWrite>(&input.action)) {
    const std::span<const Parameter> rows = axis_parameters(axes_[input.axis].axis.parameters());
    if (write->row < rows.size() && is_of_drive(rows[write->row].name)) return Refused::kSharedAmplifier;
  } else if (const auto* fault = std::get_if<InjectFault>(&input.action)) {
    if (fault->row < kInjectableFaultCount && is_of_drive(kInjectableFaults[fault->row])) {
      return Refused::kSharedAmplifier;
    }
  }
  return Refused::kNot;
}

Refused Bench::write_parameter(AxisRuntime& a, const ParameterWrite& write) noexcept {
  const AxisParameters& p = a.axis.parameters();
  const std::span<const Parameter> rows = axis_parameters(p);
  if (!std::isfinite(write.value)) return Refused::kNotFinite;
  if (write.row >= rows.size() || breaks_a_rule(rows[write.row], write.value)) return Refused::kOutOfRange;
  if (write.ramp_ticks <= 0 || rows[write.row].integer) {
    if (!set_parameter(a, write.row, write.value)) return Refused::kRuleBroken;
    a.ramps.forget(write.row);
    return Refused::kNot;
  }
  if (a.ramps.count == kMaxRamps && !a.ramps.has(write.row)) return Refused::kTooManyRamps;
  a.ramps.forget(write.row);
  a.ramps.add({.row = write.row,
               .from = rows[write.row].get(p),
               .to = write.value,
               .start = tick_,
               .ticks = write.ramp_ticks});
  return Refused::kNot;
}

bool Bench::set_parameter(AxisRuntime& a, std::size_t row, double value) noexcept {
  AxisParameters p = a.axis.parameters();
  axis_parameters(p)[row].set(p, value);
  if (breaks_a_rule(p) || (a.feeds != 0 && breaks_a_shared_rule(p.drive))) return false;
  change_parameters(a, p);
  return true;
}

void Bench::follow_ramps(AxisRuntime& a) noexcept {
  AxisParameters p = a.axis.parameters();
  const std::span<const Parameter> rows = axis_parameters(p);
  for (std::size_t i = 0; i < a.ramps.count; ++i)
    rows[a.ramps.ramp[i].row].set(p, a.ramps.ramp[i].at(tick_));
  const bool possible = !breaks_a_rule(p) && (a.feeds == 0 || !breaks_a_shared_rule(p.drive));
  if (possible) change_parameters(a, p);
  for (std::size_t i = a.ramps.count; i-- > 0;) {
    const ParameterRamp ramp = a.ramps.ramp[i];
    // The ramps together break a rule: each ramp that alone keeps the rules goes on, the others stop.
    const bool follows = possible || set_parameter(a, ramp.row, ramp.at(tick_));
    if (!follows) ++a.control.refused;
    if (!follows || ramp.is_over(tick_)) a.ramps.remove(i);
  }
}

void Bench::change_parameters(AxisRuntime& a, const AxisParameters& p) noexcept {
  a.axis.set_parameters(p);
  ++a.parameter_changes;
  if (a.feeds == 0) return;
  AxisRuntime& other = axes_[a.feeds];
  AxisParameters both = other.axis.parameters();
  both.drive = p.drive;
  other.axis.set_parameters(both);
  ++other.parameter_changes;
}

Refused Bench::inject(AxisRuntime& a, const InjectFault& fault) noexcept {
  if (!std::isfinite(fault.value)) return Refused::kNotFinite;
  if (fault.row >= kInjectableFaultCount || breaks_a_rule(kInjectableFaults[fault.row], fault.value)) {
    return Refused::kOutOfRange;
  }
  if (fault.row == kCurrentOffsetRow && a.multisine.is_on(Multisine::Quantity::kCurrentOffset)) {
    a.multisine = {};
  }
  a.axis.inject(fault.row, fault.value);
  return Refused::kNot;
}

Refused Bench::begin_multisine(AxisRuntime& a, const Multisine& multisine) noexcept {
  if (!std::isfinite(multisine.amplitude)) return Refused::kNotFinite;
  if (!is_possible(multisine)) return Refused::kOutOfRange;
  if (a.multisine.is_running()) excite(a, a.multisine.base);
  const bool is_load = multisine.quantity == Multisine::Quantity::kLoad;
  a.multisine = begun(multisine, tick_,
                      is_load ? a.axis.state().load.at(tick_) : a.axis.injected().current_sensor_offset);
  return Refused::kNot;
}

void Bench::follow_multisine(AxisRuntime& a) noexcept {
  const bool is_over = a.multisine.is_over(tick_);
  excite(a, is_over ? a.multisine.base : value_at(a.multisine, tick_));
  if (is_over) a.multisine = {};
}

void Bench::excite(AxisRuntime& a, double value) noexcept {
  if (a.multisine.is_on(Multisine::Quantity::kLoad)) {
    a.axis.set_load(value, tick_, 0);
  } else {
    a.axis.inject(kCurrentOffsetRow, value);
  }
}

}  // namespace drivebench
