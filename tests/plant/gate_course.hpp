#pragma once

#include <cstdint>
#include <vector>

#include "plant/gate_axis.hpp"
#include "tests/plant/bridge_rig.hpp"

/// A motor at gate level that is driven in six steps.
namespace drivebench::gate_course {

inline constexpr std::int64_t kPeriodNs = 50'000;
inline constexpr Picoseconds kMicro = 1'000'000;
inline constexpr Picoseconds kMilli = 1'000 * kMicro;

/// A motor that turns, with comparators behind noise and Hall lines, on a battery.
inline AxisParameters turning_motor() {
  AxisParameters p = bridge_rig::standing_motor();
  p.mechanics = {.inertia_kgm2 = 2e-6};
  p.drive.bus.resistance_ohm = 0.03;
  p.drive.bus.capacitance_f = 0.5e-3;
  p.drive.bus.battery = true;
  p.sensors.comparator = {.enabled = true, .rc_s = 0.5e-6, .hysteresis_v = 20e-3, .noise_rms_v = 5e-3};
  p.sensors.hall.enabled = true;
  return p;
}

inline LegSetting pwm(double duty, Picoseconds period = 20 * kMicro, Picoseconds dead = 200'000) {
  return {.mode = LegMode::kPwm,
          .period = period,
          .compare = static_cast<Picoseconds>(duty * static_cast<double>(period)),
          .dead = dead};
}

/// Six-step by the clock: the motor follows a field that is turned for it.
struct GateCourse {
  GateAxis axis;
  std::vector<GateEdge> edges{};

  explicit GateCourse(const AxisParameters& p, int substeps = 4) : axis(p, kPeriodNs, substeps, 7, 0) {}

  void run(Picoseconds until, std::size_t room) {
    std::vector<GateEdge> some(room);
    for (std::size_t written = room; written == room;) {
      written = axis.run(until, some);
      edges.insert(edges.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(written));
    }
  }
  void set_step(int step, double duty = 0.2) {
    constexpr int kHighLeg[6] = {1, 1, 2, 2, 0, 0};
    constexpr int kLowLeg[6] = {2, 0, 0, 1, 1, 2};
    for (int k = 0; k < 3; ++k) {
      const LegSetting open{};
      const LegSetting low{.mode = LegMode::kLow, .dead = 200'000};
      axis.set_leg(static_cast<std::size_t>(k),
                   k == kHighLeg[step] ? pwm(duty) : (k == kLowLeg[step] ? low : open));
    }
  }
};

}  // namespace drivebench::gate_course
