#pragma once

#include "plant/drive/phases.hpp"
#include "plant/train/drive_train.hpp"

// The integrals of a drive train at gate level.
namespace drivebench {

template <class Machine, class Shaft>
auto DriveTrain<Machine, Shaft>::instant_of(const AxisCore& core, const State& x, const RotorMotion& motion,
                                            const PhaseValues& current_a,
                                            const PhaseValues& voltage_v) const noexcept -> Instant {
  const bool star = core.connection == Connection::kStar;
  const auto from_link = [star](double v, double i) noexcept { return v > 0.0 ? i : (star ? 0.0 : -i); };
  const ThreePhase link_a = by_phase(from_link, piece_.circuit.start_v, current_a);
  const auto power = [](double v, double i) noexcept { return v * i; };
  const ThreePhase power_w = by_phase(power, voltage_v, current_a);
  const double torque = torque_nm(c_, x, motion);
  return {.current_a = phases_of(current_a),
          .link_a = link_a.a + link_a.b + link_a.c,
          .electrical_w = power_w.a + power_w.b + power_w.c,
          .torque_nm = torque,
          .shaft_w = torque * motion.speed_rad_s,
          .copper_w = losses_w(c_, x, motion)};
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::add_sums(const AxisCore& core, const Passed& passed, RotorMotion halfway,
                                          const PhaseValues& from_a) const noexcept {
  const auto& [start_s, duration_s, from, to, from_motion, to_motion] = passed;
  const auto slope_at = [&](const State& x, const RotorMotion& motion, const TerminalInput& u) noexcept {
    return derivative(c_, x, motion,
                      piece_.switch_ohm != 0.0 ? input_behind_switches(core.connection, x, motion) : u);
  };
  const TerminalCircuit& circuit = piece_.circuit;
  const State from_slope = slope_at(from, from_motion, circuit.start);
  const State to_slope = slope_at(to, to_motion, circuit.constant ? circuit.start : circuit.end);
  const State middle = advanced(middle_of(passed), 0.125 * duration_s, advanced(from_slope, -1.0, to_slope));
  const double turned_rad = to_motion.angle_rad - from_motion.angle_rad;
  halfway.speed_rad_s =
      1.5 * turned_rad / duration_s - 0.25 * (from_motion.speed_rad_s + to_motion.speed_rad_s);
  const PhaseValues middle_a =
      terminal_currents(core.connection, winding_currents(c_, middle, halfway), piece_.off);
  const Instant a = instant_of(core, from, from_motion, from_a, circuit.start_v);
  const PhaseValues voltage_v =
      piece_.switch_ohm == 0.0 ? middle_v()
                               : behind_switches(core.connection, piece_.drive,
                                                 before_switches(core.connection, circuit.start_v), middle_a);
  const Instant b = instant_of(core, middle, halfway, middle_a, voltage_v);
  const Instant c = instant_of(core, to, to_motion, piece_.current_a, circuit.end_v);

  GateSums& sums = core.tap->sums;
  const double sixth_s = duration_s / 6.0;
  const auto add = [sixth_s](double& sum, double from_value, double middle_value, double to_value) noexcept {
    sum += sixth_s * (from_value + 4.0 * middle_value + to_value);
  };
  add(sums.current_as.a, a.current_a.a, b.current_a.a, c.current_a.a);
  add(sums.current_as.b, a.current_a.b, b.current_a.b, c.current_a.b);
  add(sums.current_as.c, a.current_a.c, b.current_a.c, c.current_a.c);
  add(sums.link_as, a.link_a, b.link_a, c.link_a);
  add(sums.torque_nms, a.torque_nm, b.torque_nm, c.torque_nm);
  add(sums.electrical_j, a.electrical_w, b.electrical_w, c.electrical_w);
  add(sums.copper_j, a.copper_w, b.copper_w, c.copper_w);
  add(sums.shaft_j, a.shaft_w, b.shaft_w, c.shaft_w);
  const double link_v = above_negative_rail(core.connection, piece_.drive.rail_v, piece_.drive.rail_v);
  sums.link_j += link_v * sixth_s * (a.link_a + 4.0 * b.link_a + c.link_a);
  sums.link_vs += link_v * duration_s;
}

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::tell_deaths(const AxisCore& core, TerminalSet died,
                                             double at_s) const noexcept {
  for (std::uint32_t k = 0; k < 3; ++k) {
    if ((died >> k & 1U) == 0) continue;
    core.tap->events.add({.at_s = at_s, .kind = EventKind::kCurrentZero, .channel = k, .level = 0});
  }
}

}  // namespace drivebench
