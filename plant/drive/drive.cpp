#include "plant/drive/drive.hpp"

#include <algorithm>
#include <limits>

#include "plant/drive/phases.hpp"
#include "plant/math/exponential.hpp"
#include "plant/math/noise.hpp"
#include "plant/math/rounding.hpp"
#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

constexpr double kNoEdge = std::numeric_limits<double>::infinity();

/// Whether the command gives the voltages of the terminals.
constexpr bool has_voltages(Gates gates) noexcept {
  return gates == Gates::kVoltage || gates == Gates::kDuty;
}

/// Whether switches hold the terminals.
constexpr bool has_switches(Gates gates) noexcept {
  return has_voltages(gates) || gates == Gates::kEdges;
}

}  // namespace

SeriesImpedance series_impedance(const DriveParameters& p) noexcept {
  if (p.kind != DriveKind::kSource) return {};
  const SeriesImpedance own{.resistance_ohm = p.source.resistance_ohm, .inductance_h = p.source.inductance_h};
  if (!has_transformer(p.transformer)) return own;
  const TransformerConstants transformer = constants_of(p.transformer);
  return {.resistance_ohm = own.resistance_ohm + transformer.resistance_ohm,
          .inductance_h = own.inductance_h + transformer.inductance_h};
}

Drive::Drive(const DriveParameters& p, Connection connection, double period_s, std::uint64_t seed,
             std::uint64_t noise_channel) noexcept
    : connection_(connection),
      terminals_(terminal_count(connection)),
      period_s_(period_s),
      tolerance_s_(1e-9 * period_s),
      seed_(seed),
      noise_channel_(noise_channel) {
  set_parameters(p);
}

void Drive::set_parameters(const DriveParameters& p) noexcept {
  p_ = p;
  if (terminals_ < 2) p_.amplifier.offset_b_v = 0.0;
  if (terminals_ < 3) p_.amplifier.offset_c_v = 0.0;
  kind_ = p.kind;
  pwm_period_s_ = period_s_ / p.inverter.pwm_periods_per_tick;
  dead_part_ = p.inverter.dead_time_s / pwm_period_s_;
  filter_rate_per_s_ = kTurnRad * p.amplifier.filter_hz;
  // A winding between two legs has a switch or a diode of both in its way.
  const double in_series = connection_ == Connection::kStar ? 1.0 : 2.0;
  diode_v_ = kind_ == DriveKind::kSwitched ? in_series * p.inverter.diode_v : 0.0;
  switch_ohm_ = kind_ == DriveKind::kSwitched ? in_series * p.inverter.switch_ohm : 0.0;
  source_ = constants_of(p.source, connection_);
  foresees_link_ = kind_ == DriveKind::kSwitched && p.bus.battery && p.bus.resistance_ohm > 0.0;
  has_transformer_ = kind_ == DriveKind::kSource && has_transformer(p.transformer);
  transformer_ = constants_of(p.transformer);
}

DriveMemory Drive::initial() const noexcept {
  DriveMemory m;
  if (kind_ == DriveKind::kSource) {
    m.contactor_closed = p_.source.contactor && !p_.source.choose_angle ? 1.0 : 0.0;
  } else {
    m.bus_v = supply_voltage_v(p_.bus, p_.amplifier.voltage_limit_v, connection_);
  }
  return m;
}

void Drive::begin_tick(DriveMemory& m, const PhaseCommand& command, const InjectedFaults& faults,
                       Tick tick) noexcept {
  m.switched_off = 0.0;
  m.saturated = 0.0;
  take_faults(faults);
  steady_ = false;
  if (kind_ == DriveKind::kSource) {
    source_amplitude_v_ = p_.source.amplitude_v * (1.0 - faults.bus_sag);
    begin_source(m);
    return;
  }
  supply_v_ = supply_voltage_v(p_.bus, p_.amplifier.voltage_limit_v, connection_) * (1.0 - faults.bus_sag);
  const bool stiff = p_.bus.capacitance_f == 0.0;
  take_stiff_link(m);
  m.commands[static_cast<std::size_t>(tick) % m.commands.size()] =
      faults.command_corruption > 0.0 ? corrupted(command, faults.command_corruption, tick) : command;
  take_orders(m, faults, tick);
  follows_ = !stiff || filter_rate_per_s_ > 0.0 || kind_ == DriveKind::kCurrent;
  const bool one_order = later_s_ <= tolerance_s_;
  switches_ = kind_ == DriveKind::kSwitched && has_switches(orders_[1].gates) && !holds_ &&
              p_.inverter.bootstrap_s == 0.0;
  if (one_order && !follows_ && (kind_ == DriveKind::kVoltage || switches_)) {
    steady_output_ = bridge_output(m, 0.0, period_s_, {});
    steady_ = true;
  }
}

void Drive::take_stiff_link(DriveMemory& m) const noexcept {
  if (kind_ != DriveKind::kSource && p_.bus.capacitance_f == 0.0) m.bus_v = supply_v_;
}

void Drive::switch_off(DriveMemory& m) noexcept {
  m.switched_off = 1.0;
  m.contactor_closed = 0.0;
}

void Drive::take_faults(const InjectedFaults& faults) noexcept {
  hold_ = {};
  holds_ = false;
  field_lost_ = faults.field_loss != 0.0;
  const auto hold = [this](double fault, Hold what) {
    if (fault == 0.0 || fault > terminals_) return;
    hold_[static_cast<std::size_t>(fault) - 1] = what;
    holds_ = true;
  };
  if (kind_ != DriveKind::kSource) {
    hold(faults.leg_stuck_off, Hold::kOff);
    hold(faults.leg_stuck_low, Hold::kLow);
    hold(faults.leg_stuck_high, Hold::kHigh);
  }
  hold(faults.open_phase, Hold::kOpen);
}

PhaseCommand Drive::corrupted(const PhaseCommand& command, double probability, Tick tick) const noexcept {
  const auto noise = [&](std::uint64_t n) {
    return uniform_noise(seed_, noise_channel_ + n, static_cast<std::uint64_t>(tick));
  };
  if (!(noise(0) < probability)) return command;
  if (command.gates == Gates::kEdges) return {};  // a list that is damaged is recognised
  const bool duties = command.gates == Gates::kDuty;
  const double full_scale = duties                             ? 1.0
                            : command.gates == Gates::kCurrent ? p_.current_loop.limit_a
                                                               : p_.amplifier.voltage_limit_v;
  const auto value = [&](std::uint64_t n) { return full_scale * (2.0 * noise(n) - 1.0); };
  const auto phase = [&](std::uint64_t n) {
    return duties && connection_ == Connection::kStar ? noise(n) : value(n);
  };
  return {.gates = command.gates,
          .legs_off = command.legs_off,
          .setpoint = {.a = phase(1), .b = phase(2), .c = phase(3), .field = value(4)}};
}

/// With a delay of n + f ticks the command of n ticks ago takes over from the one before it f T into the
/// tick; in a switched inverter, which loads its comparators once per carrier period, when the next period
/// begins.
void Drive::take_orders(DriveMemory& m, const InjectedFaults& faults, Tick tick) noexcept {
  const double delay_ticks = p_.amplifier.delay_ticks + faults.command_delay;
  std::int64_t whole = floor_to_integer(delay_ticks);
  later_s_ = (delay_ticks - static_cast<double>(whole)) * period_s_;
  if (kind_ == DriveKind::kSwitched) {
    later_s_ =
        pwm_period_s_ * -static_cast<double>(floor_to_integer((tolerance_s_ - later_s_) / pwm_period_s_));
  }
  if (later_s_ > period_s_ - tolerance_s_) {
    later_s_ = 0.0;
    ++whole;
  }
  const auto size = static_cast<Tick>(m.commands.size());
  const auto of_tick = [&](Tick t) -> const PhaseCommand& {
    return m.commands[static_cast<std::size_t>((t + size) % size)];
  };
  const bool changes = later_s_ > tolerance_s_;
  take_order(orders_[1], of_tick(tick - whole), m);
  if (changes) take_order(orders_[0], of_tick(tick - whole - 1), m);
  take_edges(orders_[1], m, tick, whole, later_s_);
  if (changes) take_edges(orders_[0], m, tick, whole + 1, later_s_ - period_s_);
  has_edges_ = changes || kind_ == DriveKind::kSwitched;
}

void Drive::take_order(Order& order, const PhaseCommand& command, DriveMemory& m) const noexcept {
  order.gates = Gates::kOff;
  order.legs_off = command.legs_off;
  const ThreePhase phases = existing(phases_of(command.setpoint), terminals_);
  const PhaseValues setpoint{.a = phases.a, .b = phases.b, .c = phases.c, .field = command.setpoint.field};
  if (command.gates == Gates::kCurrent && kind_ == DriveKind::kCurrent) {
    order.gates = Gates::kCurrent;
    order.setpoint = limited_currents(p_.current_loop, setpoint, connection_);
  } else if (has_voltages(command.gates)) {
    order.gates = command.gates;
    order.setpoint = command.gates == Gates::kDuty ? parts_of_rail(connection_, setpoint)
                                                   : amplified(p_.amplifier, setpoint);
    if (kind_ == DriveKind::kSwitched) {
      const LimitedVoltages v = limited(m, order.gates, phases_of(wanted_voltages(m, order, {})));
      if (v.saturated) m.saturated = 1.0;
      order.pattern.set_voltages(v.voltage_v, terminals_, rail_v(m), p_.inverter.dead_time_s, pwm_period_s_,
                                 order.legs_off);
    }
  } else if (command.gates == Gates::kZeroVoltage) {
    order.gates = Gates::kZeroVoltage;
  }
}

void Drive::take_edges(Order& order, const DriveMemory& m, Tick tick, Tick ago,
                       double origin_s) const noexcept {
  const auto size = static_cast<Tick>(m.commands.size());
  const auto command = [&](Tick n) -> const PhaseCommand& {
    return m.commands[static_cast<std::size_t>((tick - n + size) % size)];
  };
  if (command(ago).gates != Gates::kEdges || kind_ != DriveKind::kSwitched) return;
  const auto edges = [&](Tick n) {
    return n < size && command(n).gates == Gates::kEdges ? command(n).edges : LegEdges{};
  };
  order.gates = Gates::kEdges;
  order.setpoint = {.field = command(ago).setpoint.field};
  order.origin_s = origin_s;
  order.pattern.set_edges({.now = edges(ago), .before = edges(ago + 1), .earlier = edges(ago + 2)},
                          terminals_, p_.inverter.dead_time_s, period_s_, order.legs_off);
}

double Drive::pwm_start_s(double start_s) const noexcept {
  if (p_.inverter.pwm_periods_per_tick == 1) return 0.0;
  return pwm_period_s_ * static_cast<double>(floor_to_integer((start_s + tolerance_s_) / pwm_period_s_));
}

double Drive::edge_after(const DriveMemory& m, double start_s) const noexcept {
  const double instant_s = start_s + tolerance_s_;
  double next_s = kNoEdge;
  if (kind_ == DriveKind::kSource) {
    if (closing_s_ > instant_s) next_s = closing_s_;
    if (has_corners_) {
      next_s = std::min(next_s, instant_s + time_to_corner_s(p_.source, source_, source_angle_at(instant_s)));
    }
    return next_s < period_s_ - tolerance_s_ ? next_s : kNoEdge;
  }
  if (later_s_ > instant_s) next_s = later_s_;
  if (kind_ == DriveKind::kSwitched) {
    const Order& order = order_at(start_s);
    const double pattern_s = pattern_start_s(order, start_s);
    const double end_s =
        order.pattern.end_s(order.pattern.segment_at(instant_s - pattern_s, segment_hint(m)));
    const bool again = order.gates != Gates::kEdges;  // a carrier period begins after its end
    next_s = std::min(next_s, pattern_s + (again ? std::min(end_s, pwm_period_s_) : end_s));
  }
  return next_s < period_s_ - tolerance_s_ ? next_s : kNoEdge;
}

TerminalDrive Drive::bridge_output(DriveMemory& m, double start_s, double duration_s,
                                   const PhaseValues& current_a) const noexcept {
  const Order& order = order_at(start_s);
  const Gates gates = m.switched_off != 0.0 ? Gates::kOff : order.gates;
  TerminalDrive out;
  out.rail_v = rail_v(m);
  out.diode_v = diode_v_;
  out.switch_ohm = switch_ohm_;
  if (has_switches(gates) || gates == Gates::kCurrent) {
    drive_terminals(m, order, start_s, current_a, out);
  } else if (gates == Gates::kOff) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(terminals_); ++k)
      out.mode[k] = TerminalMode::kDiodes;
  }
  if (filter_rate_per_s_ > 0.0 && gates != Gates::kOff) filter(m, duration_s, out);
  if (order.legs_off != 0) open_legs(order.legs_off, out);
  if (holds_) hold_terminals(out);
  if (foresees_link_) foresee_link(m, duration_s, current_a, out);
  if (field_lost_) {
    out.field_v = 0.0;
  } else if (p_.source.field_v != 0.0) {
    out.field_v = p_.source.field_v;
  }
  return out;
}

PhaseValues Drive::loop_voltages(const DriveMemory& m, const PhaseValues& setpoint_a,
                                 const PhaseValues& current_a) const noexcept {
  const auto voltage_v = [this](double wanted_a, double is_a, double integral_v) {
    return loop_voltage_v(p_.current_loop, wanted_a - is_a, integral_v);
  };
  return amplified(p_.amplifier, by_terminal(voltage_v, setpoint_a, current_a, m.integral_v));
}

PhaseValues Drive::wanted_voltages(const DriveMemory& m, const Order& order,
                                   const PhaseValues& current_a) const noexcept {
  if (order.gates == Gates::kCurrent) return loop_voltages(m, order.setpoint, current_a);
  if (order.gates != Gates::kDuty && order.gates != Gates::kEdges) return order.setpoint;
  const double rail = rail_v(m);
  return amplified(p_.amplifier, {.a = order.setpoint.a * rail,
                                  .b = order.setpoint.b * rail,
                                  .c = order.setpoint.c * rail,
                                  .field = order.setpoint.field * m.bus_v});
}

LimitedVoltages Drive::limited(const DriveMemory& m, Gates gates, const ThreePhase& wanted_v) const noexcept {
  if (!is_inverter()) return clipped(wanted_v, limit_v(m));
  return gates == Gates::kDuty ? clipped(wanted_v, rail_v(m))
                               : bridge_voltages(connection_, m.bus_v, wanted_v);
}

void Drive::drive_terminals(DriveMemory& m, const Order& order, double start_s, const PhaseValues& current_a,
                            TerminalDrive& out) const noexcept {
  if (kind_ == DriveKind::kSwitched) {
    put_switches(m, order, start_s, out);
    if (order.setpoint.field == 0.0) return;
  }
  const PhaseValues wanted_v = wanted_voltages(m, order, current_a);
  const double field_limit_v = is_inverter() ? m.bus_v : limit_v(m);
  out.field_v = std::clamp(wanted_v.field, -field_limit_v, field_limit_v);
  bool saturated = out.field_v != wanted_v.field && p_.source.field_v == 0.0;
  if (kind_ != DriveKind::kSwitched) {
    const LimitedVoltages v = limited(m, order.gates, phases_of(wanted_v));
    saturated = saturated || v.saturated;
    out.start_v = v.voltage_v;
    if (is_inverter()) out.start_v = with_dead_time(v.voltage_v, out.rail_v, current_a);
  }
  if (saturated) m.saturated = 1.0;
}

void Drive::find_segment(DriveMemory& m, const Order& order, double start_s) const noexcept {
  const double instant_s = start_s + tolerance_s_ - pattern_start_s(order, start_s);
  m.pwm_segment = static_cast<std::int64_t>(order.pattern.segment_at(instant_s, segment_hint(m)));
}

void Drive::put_switches(DriveMemory& m, const Order& order, double start_s,
                         TerminalDrive& out) const noexcept {
  find_segment(m, order, start_s);
  order.pattern.put(segment_hint(m), terminals_, out.rail_v, out);
  if (starved_ == 0) return;
  for (int k = 0; k < terminals_; ++k) {
    const bool starved = (starved_ >> k & 1U) != 0 && phase(out.start_v, k) > 0.0;
    if (starved) out.mode[static_cast<std::size_t>(k)] = TerminalMode::kDiodes;
  }
}

LegLevels Drive::closed_switches(DriveMemory& m, double start_s) const noexcept {
  LegLevels closed{LegLevel::kOff, LegLevel::kOff, LegLevel::kOff};
  const Order& order = order_at(start_s);
  if (m.switched_off != 0.0 || !has_switches(order.gates)) return closed;
  TerminalDrive out{.rail_v = 1.0};
  put_switches(m, order, start_s, out);
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals_); ++k) {
    if (out.mode[k] != TerminalMode::kDriven || (order.legs_off >> k & 1U) != 0) continue;
    closed[k] = phase(out.start_v, static_cast<int>(k)) > 0.0 ? LegLevel::kHigh : LegLevel::kLow;
  }
  return closed;
}

bool Drive::switch_terminals(DriveMemory& m, double start_s, TerminalDrive& out) const noexcept {
  const std::int64_t before = m.pwm_segment;
  find_segment(m, orders_[1], start_s);
  if (m.pwm_segment == before) return false;
  orders_[1].pattern.put(segment_hint(m), terminals_, out.rail_v, out);
  return true;
}

ThreePhase Drive::with_dead_time(const ThreePhase& voltage_v, double rail_v,
                                 const PhaseValues& current_a) const noexcept {
  const auto with = [&](double v, double i) {
    return averaged_voltage_v(v, rail_v, dead_part_, i, p_.inverter.dead_time_band_a);
  };
  return by_phase(with, voltage_v, current_a);
}

void Drive::filter(DriveMemory& m, double duration_s, TerminalDrive& out) const noexcept {
  const double half = exponential(-0.5 * filter_rate_per_s_ * duration_s);
  const auto after = [](double decay) {
    return [decay](double from, double input) { return filtered(from, input, decay); };
  };
  m.filter_input_v = out.start_v;
  out.constant = false;
  out.start_v = m.filtered_v;
  out.middle_v = by_phase(after(half), m.filtered_v, m.filter_input_v);
  out.end_v = by_phase(after(half * half), m.filtered_v, m.filter_input_v);
}

void Drive::open_legs(std::uint32_t legs_off, TerminalDrive& out) const noexcept {
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals_); ++k) {
    if ((legs_off >> k & 1U) != 0) out.mode[k] = TerminalMode::kDiodes;
  }
}

void Drive::hold_terminals(TerminalDrive& out) const noexcept {
  for (int k = 0; k < terminals_; ++k) {
    const Hold hold = hold_[static_cast<std::size_t>(k)];
    if (hold == Hold::kNone) continue;
    TerminalMode& mode = out.mode[static_cast<std::size_t>(k)];
    mode = hold == Hold::kOpen  ? TerminalMode::kOpen
           : hold == Hold::kOff ? TerminalMode::kDiodes
                                : TerminalMode::kDriven;
    if (mode != TerminalMode::kDriven) continue;
    const double held_v = hold == Hold::kHigh ? out.rail_v : -out.rail_v;
    phase(out.start_v, k) = phase(out.middle_v, k) = phase(out.end_v, k) = held_v;
  }
}

}  // namespace drivebench
