// Changes of a running axis: parameters, at once or on a ramp, and injected faults.
#include <cmath>
#include <span>

#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"

namespace drivebench {

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
  if (breaks_a_rule(p)) return false;
  change_parameters(a, p);
  return true;
}

void Bench::follow_ramps(AxisRuntime& a) noexcept {
  AxisParameters p = a.axis.parameters();
  const std::span<const Parameter> rows = axis_parameters(p);
  for (std::size_t i = 0; i < a.ramps.count; ++i)
    rows[a.ramps.ramp[i].row].set(p, a.ramps.ramp[i].at(tick_));
  const bool possible = !breaks_a_rule(p);
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
}

Refused Bench::inject(AxisRuntime& a, const InjectFault& fault) noexcept {
  if (!std::isfinite(fault.value)) return Refused::kNotFinite;
  if (fault.row >= kInjectableFaultCount || breaks_a_rule(kInjectableFaults[fault.row], fault.value)) {
    return Refused::kOutOfRange;
  }
  a.axis.inject(fault.row, fault.value);
  return Refused::kNot;
}

}  // namespace drivebench
