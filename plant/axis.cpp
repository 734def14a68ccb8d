#include "plant/axis.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plant/noise.hpp"
#include "plant/rk4.hpp"

namespace drivebench {
namespace {

constexpr double kTurnRad = 2.0 * std::numbers::pi;

// Far outside of every machine of this bench; a state beyond it has diverged.
constexpr double kEnvelope = 1e9;

double sign_of(double x) noexcept {
  return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0);
}

/// Fraction of a step at which a value that goes linearly from `from` to `to` reaches zero; 1 if it does not.
double zero_crossing(double from, double to) noexcept {
  return from * to < 0.0 ? from / (from - to) : 1.0;
}

}  // namespace

Axis::Axis(const AxisParameters& p, AxisTiming timing, std::uint64_t seed, std::uint64_t index) noexcept
    : p_(p),
      machine_(constants_of(p.machine)),
      encoder_(p.encoder, timing.period_s),
      timing_(timing),
      step_s_(timing.period_s / timing.substeps),
      seed_(seed),
      noise_channel_(2 * index),
      has_dry_friction_(p.mechanics.coulomb_friction_nm > 0.0 || p.mechanics.static_friction_nm > 0.0) {
  state_.encoder.count = encoder_.count_at(0.0, 0);
}

void Axis::set_parameters(const AxisParameters& p) noexcept {
  p_ = p;
  machine_ = constants_of(p.machine);
  has_dry_friction_ = p.mechanics.coulomb_friction_nm > 0.0 || p.mechanics.static_friction_nm > 0.0;
}

Axis::Branch Axis::branch_at(const DriveState& x, const PhaseCommand& command, TwoPhase voltage_v,
                             double load_nm) const noexcept {
  Branch branch{{.voltage_v = voltage_v}, {}};
  if (command.gates == Gates::kOff) {
    // A diode conducts while current flows, against the voltage of the DC link; without current it starts to
    // conduct only when the back-emf exceeds that voltage.
    const TwoPhase open_v = open_circuit_voltage_v(machine_, x.machine, x.shaft.speed_rad_s);
    const auto diode = [this](double current_a, double open_circuit_v, double& v, double& conducts) {
      const double link_v = p_.amplifier.voltage_limit_v;
      conducts = current_a != 0.0 || std::abs(open_circuit_v) > link_v ? 1.0 : 0.0;
      v = current_a != 0.0 ? -sign_of(current_a) * link_v : sign_of(open_circuit_v) * link_v;
      if (conducts == 0.0) v = open_circuit_v;
    };
    diode(x.machine.i_a_a, open_v.a, branch.terminals.voltage_v.a, branch.terminals.conducts.a);
    diode(x.machine.i_b_a, open_v.b, branch.terminals.voltage_v.b, branch.terminals.conducts.b);
  }
  if (has_dry_friction_) {
    branch.friction =
        friction_branch(p_.mechanics, x.shaft.speed_rad_s, torque_nm(machine_, x.machine) - load_nm);
  }
  return branch;
}

DriveState Axis::integrated(const DriveState& x, double duration_s, const Branch& branch,
                            double load_nm) const noexcept {
  return rk4_step(x, duration_s, [&](const DriveState& s) noexcept -> DriveState {
    return {
        .machine = derivative(machine_, s.machine, s.shaft.speed_rad_s, branch.terminals),
        .shaft = derivative(p_.mechanics, s.shaft, torque_nm(machine_, s.machine), load_nm, branch.friction)};
  });
}

void Axis::record_segment(double start_s, double duration_s, const ShaftState& from,
                          const ShaftState& to) noexcept {
  segments_[segment_count_++] = {.start_s = start_s,
                                 .duration_s = duration_s,
                                 .start_rad = from.angle_rad,
                                 .end_rad = to.angle_rad,
                                 .start_rad_s = from.speed_rad_s,
                                 .end_rad_s = to.speed_rad_s};
}

void Axis::substep(double start_s, double duration_s, const PhaseCommand& command, TwoPhase voltage_v,
                   double load_nm) noexcept {
  const bool freewheels = command.gates == Gates::kOff;
  const bool has_events = freewheels || has_dry_friction_;
  for (std::size_t events = 0;; ++events) {
    const DriveState from = state_.drive;
    const Branch branch = branch_at(from, command, voltage_v, load_nm);
    state_.voltage_v = branch.terminals.voltage_v;
    DriveState to = integrated(from, duration_s, branch, load_nm);
    double fraction = 1.0;
    if (has_events && events < kMaxEvents) {
      const double stop =
          has_dry_friction_ ? zero_crossing(from.shaft.speed_rad_s, to.shaft.speed_rad_s) : 1.0;
      const double a_off = freewheels ? zero_crossing(from.machine.i_a_a, to.machine.i_a_a) : 1.0;
      const double b_off = freewheels ? zero_crossing(from.machine.i_b_a, to.machine.i_b_a) : 1.0;
      fraction = std::min({stop, a_off, b_off});
      if (fraction < 1.0) {
        to = integrated(from, fraction * duration_s, branch, load_nm);
        if (fraction == stop) to.shaft.speed_rad_s = 0.0;
        if (fraction == a_off) to.machine.i_a_a = 0.0;
        if (fraction == b_off) to.machine.i_b_a = 0.0;
      }
    }
    record_segment(start_s, fraction * duration_s, from.shaft, to.shaft);
    state_.drive = to;
    if (fraction == 1.0) return;
    start_s += fraction * duration_s;
    duration_s -= fraction * duration_s;
  }
}

void Axis::advance(const PhaseCommand& command, Tick tick) noexcept {
  if ((state_.faults & kDiverged) != 0) return;
  const DriveState before = state_.drive;
  state_.faults &= kLatchedFaults;
  segment_count_ = 0;
  last_tick_turn_ = state_.turns;
  last_tick_count_ = state_.encoder.count;
  const double load_nm = state_.load.at(tick);
  const double limit_a = p_.amplifier.over_current_a;
  PhaseCommand effective = command;
  if ((state_.faults & kOverCurrentTrip) != 0) effective.gates = Gates::kOff;
  const AmplifierOutput output = amplifier_output(p_.amplifier, effective);
  if (output.saturated) state_.faults |= kVoltageSaturated;
  for (int n = 0; n < timing_.substeps; ++n) {
    substep(n * step_s_, step_s_, effective, output.voltage_v, load_nm);
    if (std::abs(state_.drive.machine.i_a_a) > limit_a || std::abs(state_.drive.machine.i_b_a) > limit_a) {
      state_.faults |= kOverCurrent;
      if (p_.amplifier.over_current_trip) {
        state_.faults |= kOverCurrentTrip;
        effective.gates = Gates::kOff;  // for the substeps that are left, too
      }
    }
  }
  if (!finite()) {
    state_.drive = before;
    state_.faults |= kDiverged;
    segment_count_ = 0;
    return;
  }
  encoder_.follow(state_.encoder, last_tick(), tick, last_tick_turn_);
  if (has_dry_friction_ && state_.drive.shaft.speed_rad_s == 0.0) state_.faults |= kShaftHeld;
  wrap_angle();
}

void Axis::wrap_angle() noexcept {
  double& angle_rad = state_.drive.shaft.angle_rad;
  if (angle_rad >= 0.0 && angle_rad < kTurnRad) return;
  const std::int64_t whole = floor_to_integer(angle_rad / kTurnRad);
  angle_rad -= static_cast<double>(whole) * kTurnRad;
  state_.turns += whole;
  if (angle_rad < 0.0) {
    angle_rad = 0.0;  // the quotient was rounded up
  } else if (angle_rad >= kTurnRad) {
    angle_rad = 0.0;  // so little below a turn that the difference is rounded up to it
    ++state_.turns;
  }
}

bool Axis::finite() const noexcept {
  const DriveState& x = state_.drive;
  const double size = std::abs(x.machine.i_a_a) + std::abs(x.machine.i_b_a) + std::abs(x.machine.psi_a_wb) +
                      std::abs(x.machine.psi_b_wb) + std::abs(x.shaft.speed_rad_s) +
                      std::abs(x.shaft.angle_rad);
  return size < kEnvelope;  // false for NaN as well
}

AxisSample Axis::sample(Tick tick) const noexcept {
  const DriveState& x = state_.drive;
  const CurrentSensorParameters& sensor = p_.current_sensor;
  double noise_a = 0.0;
  double noise_b = 0.0;
  if (sensor.noise_rms_a > 0.0) {
    noise_a = gaussian_noise(seed_, noise_channel_, static_cast<std::uint64_t>(tick));
    noise_b = gaussian_noise(seed_, noise_channel_ + 1, static_cast<std::uint64_t>(tick));
  }
  const CurrentReading a = read_current(sensor, sensor.gain_a, sensor.offset_a_a, x.machine.i_a_a, noise_a);
  const CurrentReading b = read_current(sensor, sensor.gain_b, sensor.offset_b_a, x.machine.i_b_a, noise_b);
  return {.current_a = {a.current_a, b.current_a},
          .encoder_count = state_.encoder.count,
          .encoder_levels = encoder_.levels(state_.encoder),
          .edge_age_s = encoder_.edge_age_s(state_.encoder, tick),
          .edge_period_s = state_.encoder.period_s,
          .index_count = state_.encoder.index_count,
          .index_tick = state_.encoder.index_tick,
          .voltage_v = state_.voltage_v,
          .faults = state_.faults | (a.saturated || b.saturated ? kCurrentSensorSaturated : 0),
          .angle_rad = static_cast<double>(state_.turns) * kTurnRad + x.shaft.angle_rad,
          .speed_rad_s = x.shaft.speed_rad_s,
          .torque_nm = torque_nm(machine_, x.machine),
          .load_nm = state_.load.at(tick),
          .true_current_a = {x.machine.i_a_a, x.machine.i_b_a},
          .rotor_flux_wb = {x.machine.psi_a_wb, x.machine.psi_b_wb},
          .bus_voltage_v = p_.amplifier.voltage_limit_v};
}

}  // namespace drivebench
