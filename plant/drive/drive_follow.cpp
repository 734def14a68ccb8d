// The state of the drive after an interval: filter, current loop and link, which its output foresees; and the
// output of a shared drive.
#include <algorithm>
#include <cmath>

#include "plant/drive/drive.hpp"
#include "plant/drive/phases.hpp"
#include "plant/math/exponential.hpp"

namespace drivebench {
namespace {

double mean(double x, double y) noexcept {
  return 0.5 * (x + y);
}

}  // namespace

void Drive::follow(DriveMemory& m, double start_s, double duration_s, const TerminalDrive& applied,
                   const PhaseValues& voltage_v, const PhaseValues& from_a,
                   const PhaseValues& to_a) const noexcept {
  if (kind_ == DriveKind::kSource) {
    if (has_transformer_) {
      follow_transformer(m, start_s, duration_s, applied, from_a, to_a);
    } else {
      follow_start_capacitor(m, duration_s, applied, from_a, to_a);
    }
    return;
  }
  if (filter_rate_per_s_ > 0.0) follow_filter(m, duration_s, applied, voltage_v);
  if (kind_ == DriveKind::kCurrent) follow_loop(m, start_s, duration_s, from_a, to_a);
  if (p_.bus.capacitance_f == 0.0) return;
  const bool loses = diode_v_ != 0.0 || switch_ohm_ != 0.0;
  follow_bus(m, duration_s, applied, loses ? link_side_v(applied, voltage_v) : voltage_v, from_a, to_a);
}

/// With the gates off the filter follows the terminals, which the machine and the diodes hold.
void Drive::follow_filter(DriveMemory& m, double duration_s, const TerminalDrive& applied,
                          const PhaseValues& voltage_v) const noexcept {
  const double decay = exponential(-filter_rate_per_s_ * duration_s);
  const auto after = [&](double from, double input) { return filtered(from, input, decay); };
  ThreePhase shaped_v = by_phase(after, m.filtered_v, m.filter_input_v);
  ThreePhase terminal_v = phases_of(voltage_v);
  for (int k = 0; k < terminals_; ++k) {
    const bool diodes = applied.mode[static_cast<std::size_t>(k)] == TerminalMode::kDiodes;
    if (applied.constant || diodes) phase(shaped_v, k) = phase(terminal_v, k);
  }
  m.filtered_v = shaped_v;
}

void Drive::follow_loop(DriveMemory& m, double start_s, double duration_s, const PhaseValues& from_a,
                        const PhaseValues& to_a) const noexcept {
  const Order& order = order_at(start_s);
  if (order.gates != Gates::kCurrent || m.switched_off != 0.0) {
    m.integral_v = {};
    return;
  }
  const PhaseValues wanted_v = loop_voltages(m, order.setpoint, from_a);
  const double clip_v = limit_v(m);
  const auto after = [&](double integral_v, double asked_v, double wanted_a, double i0_a, double i1_a) {
    const double error_a = wanted_a - mean(i0_a, i1_a);
    return integral_after(p_.current_loop, integral_v, asked_v, clip_v, error_a, duration_s);
  };
  m.integral_v = by_terminal(after, m.integral_v, wanted_v, order.setpoint, from_a, to_a);
  if ((order.legs_off & 1U) != 0) m.integral_v.a = 0.0;
  if ((order.legs_off & 2U) != 0) m.integral_v.b = 0.0;
  if ((order.legs_off & 4U) != 0) m.integral_v.c = 0.0;
  if (connection_ == Connection::kStar) {
    const ThreePhase star = without_neutral(phases_of(m.integral_v));
    m.integral_v = {.a = star.a, .b = star.b, .c = star.c, .field = m.integral_v.field};
  }
}

PhaseValues Drive::link_side_v(const TerminalDrive& applied, const PhaseValues& voltage_v) const noexcept {
  ThreePhase v = phases_of(voltage_v);
  ThreePhase driven_v = applied.start_v;
  for (int k = 0; k < terminals_; ++k) {
    const bool driven = applied.mode[static_cast<std::size_t>(k)] == TerminalMode::kDriven;
    double& of_phase = phase(v, k);
    of_phase = driven ? phase(driven_v, k) : std::clamp(of_phase, -applied.rail_v, applied.rail_v);
  }
  return {.a = v.a, .b = v.b, .c = v.c, .field = voltage_v.field};
}

/// The field has a supply of its own; what an arc takes does not come back to the link.
void Drive::follow_bus(DriveMemory& m, double duration_s, const TerminalDrive& applied,
                       const PhaseValues& voltage_v, const PhaseValues& from_a,
                       const PhaseValues& to_a) const noexcept {
  const auto power = [](double v, double i0_a, double i1_a) { return v * mean(i0_a, i1_a); };
  ThreePhase power_w = by_phase(power, voltage_v, from_a, to_a);
  double taken_w = 0.0;
  for (int k = 0; k < terminals_; ++k) {
    if (applied.mode[static_cast<std::size_t>(k)] != TerminalMode::kOpen) taken_w += phase(power_w, k);
  }
  m.bus_v =
      bus_after(p_.bus, supply_v_, m.bus_v, m.chopper != 0.0, taken_w * duration_s, duration_s).voltage_v;
  m.chopper = chopper_after(p_.bus, m.bus_v, m.chopper != 0.0) ? 1.0 : 0.0;
}

void Drive::foresee_link(const DriveMemory& m, double duration_s, const PhaseValues& current_a,
                         TerminalDrive& out) const noexcept {
  if (m.bus_v == 0.0) return;
  ThreePhase i = phases_of(current_a);
  double taken_w = 0.0;
  for (int k = 0; k < terminals_; ++k) {
    const TerminalMode mode = out.mode[static_cast<std::size_t>(k)];
    const double i_a = phase(i, k);
    if (mode == TerminalMode::kDriven) taken_w += phase(out.start_v, k) * i_a;
    if (mode == TerminalMode::kDiodes) taken_w -= out.rail_v * std::abs(i_a);
  }
  const ForeseenLink link =
      foreseen_link(p_.bus, supply_v_, m.bus_v, m.chopper != 0.0, taken_w / m.bus_v, duration_s);
  const double rail_v = rail_voltage_v(link.mean_v, connection_);
  const auto on_rail = [=](double v) { return v > 0.0 ? rail_v : v < 0.0 ? -rail_v : 0.0; };
  out.start_v = by_phase(on_rail, out.start_v);
  out.rail_v = rail_v;
  out.link_rise_v = link.end_v - link.mean_v;
  out.link_moves = true;
}

void Drive::share_output(const TerminalDrive& out) noexcept {
  steady_output_ = out;
  steady_output_.link_rise_v = 0.0;
  steady_output_.link_moves = false;
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals_); ++k) {
    if (hold_[k] == Hold::kOpen) steady_output_.mode[k] = TerminalMode::kOpen;
  }
  steady_ = true;
  switches_ = has_edges_ = follows_ = false;
}

void Drive::hold_legs(DriveMemory& m, const LegLevels& levels) noexcept {
  Order& order = orders_[1];
  order.gates = Gates::kEdges;
  order.legs_off = 0;
  order.setpoint = {};
  order.origin_s = 0.0;
  order.pattern.set_levels(levels, terminals_);
  later_s_ = 0.0;
  m.pwm_segment = 0;
  steady_ = switches_ = has_edges_ = false;
}

}  // namespace drivebench
