#include "server/config/sections/step.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "plant/parameters/drive_rows.hpp"
#include "plant/parameters/later_rows.hpp"
#include "protocols/text.hpp"

namespace drivebench {
namespace {

// RK4 is stable up to 2.8 times the fastest time constant, and accurate to 1e-4 of a transient at one half.
constexpr double kMaxStep = 0.5;
constexpr double kMaxCurrentLoopS = 20e-6;

double period_s_of(const BenchSetup& setup) {
  return static_cast<double>(setup.period_ns) * 1e-9;
}

/// The fastest time constant of the machine and its shaft.
double fastest_time_constant_s(const AxisParameters& p) {
  const double machine_s =
      std::visit([](const auto& machine) { return drivebench::fastest_time_constant_s(machine); }, p.machine);
  return std::min(machine_s, drivebench::fastest_time_constant_s(p.mechanics));
}

/// The cure: more substeps, or ticks so short that the largest number of substeps is enough.
std::string advice(double needed, double longest_step_s) {
  if (needed <= kMaxSubsteps) return "at least " + shortest(needed) + " substeps are needed";
  return "even " + std::to_string(kMaxSubsteps) + " substeps would need a period_us of at most " +
         shortest(std::floor(kMaxSubsteps * longest_step_s * 1e9) * 1e-3);
}

}  // namespace

int automatic_substeps(std::span<const AxisReading> axes, std::int64_t period_ns) {
  int substeps = 1;
  for (const AxisReading& axis : axes) {
    if (!axis.parameters_valid) continue;
    substeps =
        std::max(substeps, default_substeps(axis.setup.parameters, static_cast<double>(period_ns) * 1e-9));
  }
  return substeps;
}

void check_step(StrictTable& bench, const BenchSetup& setup, const AxisReading& axis) {
  const std::string_view key = bench.has("substeps") ? "substeps" : "period_us";
  const double period_s = period_s_of(setup);
  const std::string step =
      "comes to steps of " + shortest(period_s * 1e6 / setup.substeps) + " us, too long for ";
  const double fastest_s = fastest_time_constant_s(axis.setup.parameters);
  if (period_s > kMaxStep * fastest_s * setup.substeps) {
    bench.report(key, step + "the fastest time constant of axis \"" + axis.config.name + "\", " +
                          shortest(std::round(fastest_s * 1e9) * 1e-3) + " us: " +
                          advice(std::ceil(period_s / (kMaxStep * fastest_s)), kMaxStep * fastest_s));
  }
  std::vector<Problem> found;
  Problems rules(found);
  add_period_problems(axis.setup.parameters.drive, period_s, rules);
  add_period_problems(axis.setup.parameters, period_s, rules);
  for (const Problem& problem : found) {
    bench.report("period_us",
                 "does not suit axis \"" + axis.config.name + "\": " + problem.field + " " + problem.rule);
  }
  const double slack = 1.0 + 1e-9;  // rounding: 100 us in five steps are 20 us
  if (axis.setup.parameters.drive.kind == DriveKind::kCurrent &&
      period_s > kMaxCurrentLoopS * setup.substeps * slack) {
    bench.report(key, step + "the current loop of axis \"" + axis.config.name +
                          "\", which runs at each of them and needs 20 us: " +
                          advice(std::ceil(period_s / (kMaxCurrentLoopS * slack)), kMaxCurrentLoopS));
  }
}

}  // namespace drivebench
