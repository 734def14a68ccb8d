#include "plant/axis.hpp"

#include <cmath>

#include "plant/drive/phases.hpp"
#include "plant/math/rounding.hpp"
#include "plant/math/trig.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/train/shared_amplifier.hpp"
#include "plant/train/shared_shaft.hpp"

namespace drivebench {
namespace {

// Far outside of every machine of this bench; a state beyond it has diverged.
constexpr double kEnvelope = 1e9;

// Channels of noise of an axis: its analog sensors, then the corruption of commands, then its comparators.
constexpr std::uint64_t kNoiseChannels = 32;
constexpr std::uint64_t kCommandNoise = 16;
constexpr std::uint64_t kComparatorNoise = 24;

double pole_pairs_of(const MachineParameters& machine) noexcept {
  return std::visit([](const auto& p) { return drivebench::pole_pairs_of(p); }, machine);
}

bool shaft_has_events(const MechanicsParameters& p) noexcept {
  return has_events(p) || p.motion != ShaftMotion::kFree;
}

AxisCore core_of(const AxisParameters& p, AxisTiming timing, std::uint64_t seed,
                 std::uint64_t index) noexcept {
  const Connection connection = connection_of(p.machine);
  const std::uint64_t noise = kNoiseChannels * index;
  return {.p = p,
          .timing = timing,
          .step_s = timing.period_s / timing.substeps,
          .connection = connection,
          .pole_pairs = pole_pairs_of(p.machine),
          .drive = Drive(p.drive, connection, timing.period_s, seed, noise + kCommandNoise),
          .sensors =
              SensorBank(p.sensors, connection, timing.period_s, seed, noise,
                         timing.period_s / timing.substeps, kind_of(p.machine).field != FieldSupply::kNone),
          .comparators = Comparators(p.sensors.comparator, timing.period_s, seed, noise + kComparatorNoise),
          .shunts = Shunts(p.sensors.shunts, timing.period_s, p.drive.inverter.pwm_periods_per_tick),
          .encoder = Encoder(p.encoder, timing.period_s),
          .absolute = AbsoluteEncoder(p.sensors.absolute, timing.period_s),
          .hall = HallCapture(p.sensors.hall, pole_pairs_of(p.machine), timing.period_s),
          .bootstrap = Bootstrap(p.drive.inverter, timing.period_s),
          .shaft = constants_of(p.mechanics),
          .shaft_has_events = shaft_has_events(p.mechanics)};
}

RotorMotion motion_of(const AxisState& state) noexcept {
  return {
      .angle_rad = state.shaft.angle_rad, .speed_rad_s = state.shaft.speed_rad_s, .electrical = {1.0, 0.0}};
}

/// Brings the angle back into [0, 2 pi) and counts the turns.
void wrap_angle(AxisState& state) noexcept {
  double& angle_rad = state.shaft.angle_rad;
  if (angle_rad >= 0.0 && angle_rad < kTurnRad) return;
  const std::int64_t whole = floor_to_integer(angle_rad / kTurnRad);
  angle_rad -= static_cast<double>(whole) * kTurnRad;
  state.turns += whole;
  if (angle_rad < 0.0) {
    angle_rad = 0.0;  // the quotient was rounded up
  } else if (angle_rad >= kTurnRad) {
    angle_rad = 0.0;  // so little below a turn that the difference is rounded up to it
    ++state.turns;
  }
}

/// Sets values to zero that have decayed for hundreds of time constants: processors take a hundred times as
/// long for numbers so small.
void forget_negligible(AxisState& state) noexcept {
  constexpr double kNegligible = 1e-200;
  const auto kept = [](double x) { return std::abs(x) < kNegligible ? 0.0 : x; };
  for (double& word : state.machine)
    word = kept(word);
  for (double& value : state.sensors.filtered)
    value = kept(value);
  state.drive.filtered_v = by_phase(kept, state.drive.filtered_v);
  state.comparators.filtered_v = by_phase(kept, state.comparators.filtered_v);
  state.shaft.speed_rad_s = kept(state.shaft.speed_rad_s);
}

}  // namespace

Axis::Axis(const AxisParameters& p, AxisTiming timing, std::uint64_t seed, std::uint64_t index)
    : core_(core_of(p, timing, seed, index)),
      train_(kind_of(p.machine).make_train(p.machine, has_two_masses(p.mechanics))) {
  state_.drive = core_.drive.initial();
  state_.thermal.temperature_k = p.thermal.ambient_k;
  state_.encoder.count = core_.encoder.count_at(0.0, 0);
  adjust();
  state_.sensors =
      core_.sensors.settled({.bus_v = state_.drive.bus_v, .temperature_k = state_.thermal.temperature_k}, 0);
  state_.comparators = core_.comparators.settled(state_.drive.bus_v);
  state_.absolute = core_.absolute.settled(0.0);
  state_.hall = core_.hall.settled();
}

Axis::Axis(const Axis& other)
    : core_(other.core_),
      train_(other.train_->clone()),
      state_(other.state_),
      truth_(other.truth_),
      open_tick_(other.open_tick_) {}

Axis& Axis::operator=(const Axis& other) {
  if (this != &other) {
    core_ = other.core_;
    train_ = other.train_->clone();
    state_ = other.state_;
    truth_ = other.truth_;
    open_tick_ = other.open_tick_;
  }
  return *this;
}

void Axis::set_parameters(const AxisParameters& p) noexcept {
  core_.p = p;
  core_.drive.set_parameters(p.drive);
  core_.sensors.set_parameters(p.sensors);
  core_.comparators.set_parameters(p.sensors.comparator);
  core_.shunts = Shunts(p.sensors.shunts, core_.timing.period_s, p.drive.inverter.pwm_periods_per_tick);
  core_.hall = HallCapture(p.sensors.hall, core_.pole_pairs, core_.timing.period_s);
  core_.shaft = constants_of(p.mechanics);
  core_.shaft_has_events = shaft_has_events(p.mechanics);
  adjust();
}

void Axis::restore(const AxisState& state) noexcept {
  state_ = state;
  open_tick_ = -1;
  core_.injected_bits = injected_bits(state.injected);
  core_.segment_count = 0;
  adjust();
}

void Axis::bump(double impulse_nms) noexcept {
  state_.shaft = bumped(core_.shaft, state_.shaft, impulse_nms);
  look_inside();
}

void Axis::bump_output(double impulse_nms) noexcept {
  if (has_two_masses(core_.p.mechanics)) {
    state_.shaft = output_bumped(core_.shaft, state_.shaft, impulse_nms);
  } else {
    const ShaftState x{.speed_rad_s = state_.shaft.speed_rad_s, .angle_rad = state_.shaft.angle_rad};
    state_.shaft.speed_rad_s = output_bumped(core_.shaft, x, impulse_nms).speed_rad_s;
  }
  look_inside();
}

void Axis::inject(std::size_t row, double value) noexcept {
  state_.injected.*kInjectableFaults[row].member = value;
  core_.injected_bits = injected_bits(state_.injected);
  adjust();
}

void Axis::adjust() noexcept {
  Adjustment a = thermal_adjustment(core_.p.thermal, state_.thermal);
  a.stator_resistance_factor *= 1.0 + state_.injected.stator_resistance_drift;
  a.rotor_resistance_factor *= 1.0 + state_.injected.rotor_resistance_drift;
  a.magnet_factor *= 1.0 - state_.injected.demagnetisation;
  const SeriesImpedance series = series_impedance(core_.p.drive);
  a.series_resistance_ohm = series.resistance_ohm;
  a.series_inductance_h = series.inductance_h;
  train_->set_machine(core_.p.machine, a);
  look_inside();
}

void Axis::look_inside() noexcept {
  truth_ = train_->truth(state_, motion_of(state_));
}

void Axis::begin_tick(const PhaseCommand& command, Tick tick) noexcept {
  state_.faults &= kLatchedFaults;
  core_.tick = tick;
  core_.segment_count = 0;
  core_.last_tick_turn = state_.turns;
  core_.last_tick_encoder = state_.encoder;
  core_.drive.begin_tick(state_.drive, command, state_.injected, tick);
  if ((state_.faults & kGatesOffFaults) != 0) core_.drive.switch_off(state_.drive);
  begin_break();
  begin_bootstrap();
  if (core_.p.sensors.terminals) state_.terminal_mean_v = {};
  core_.follows = core_.drive.follows() || core_.sensors.follows() || core_.p.thermal.enabled ||
                  core_.p.sensors.follow_terminals() || has_impedance(core_.p.drive) || core_.breaks ||
                  core_.shunts.used() || core_.bootstrap.used() || has_switch_losses(core_.p.drive);
}

void Axis::begin_break() noexcept {
  BreakMemory& m = state_.break_input;
  if (m.pending != 0) m.due_s -= core_.timing.period_s;
  const bool line = state_.injected.gate_driver_fault != 0.0 && (state_.faults & kBreakInput) == 0;
  if (line && m.pending == 0) pull_break(core_, state_, 0.0);
  core_.breaks = m.pending != 0 || watches_break(core_, state_);
}

void Axis::begin_bootstrap() noexcept {
  if (!core_.bootstrap.used()) return;
  core_.bootstrap.begin_tick(state_.bootstrap);
  core_.drive.starve(state_.bootstrap.empty);
  if (state_.bootstrap.empty != 0) state_.faults |= kBootstrapEmpty;
}

/// What the sensors of the position see of the last segments.
void Axis::follow_rotor() noexcept {
  const std::span<const AngleSegment> segments = last_tick();
  core_.encoder.follow(state_.encoder, segments, core_.tick, core_.last_tick_turn, state_.injected);
  if (core_.absolute.enabled()) core_.absolute.follow(state_.absolute, segments);
  if (core_.hall.enabled()) {
    core_.hall.follow(state_.hall, segments, core_.tick, core_.last_tick_turn, state_.injected);
  }
}

double Axis::load_at(Tick tick) const noexcept {
  const double load_nm = state_.load.at(tick);
  if (core_.p.mechanics.load_profile.empty()) return load_nm;
  return load_nm + profile_load_nm(core_.p.mechanics, static_cast<double>(tick) * core_.timing.period_s);
}

void Axis::hold(const MotionState& before) noexcept {
  state_.machine = before.machine;
  state_.shaft = before.shaft;
  state_.drive = core_.drive.initial();
  state_.sensors.filtered = {};
  state_.comparators.filtered_v = {};
  state_.faults |= kDiverged;
  core_.segment_count = 0;
  look_inside();
}

PhaseValues Axis::sensed_currents() const noexcept {
  PhaseValues i = terminal_currents(core_.connection, truth_.current_a, state_.open_terminals);
  if (!core_.shunts.used()) return i;
  const std::array<double, 3>& held_a = state_.shunts.held_a;
  return {.a = held_a[0], .b = held_a[1], .c = held_a[2], .field = i.field};
}

void Axis::end_tick(const MotionState& before, Tick tick) noexcept {
  if (!finite()) return hold(before);
  if (state_.drive.saturated != 0.0) state_.faults |= kVoltageSaturated;
  follow_rotor();
  if (core_.absolute.enabled()) core_.absolute.end_tick(state_.absolute, tick + 1);
  if (core_.shaft_has_events && state_.shaft.speed_rad_s == 0.0) state_.faults |= kShaftHeld;
  wrap_angle(state_);
  forget_negligible(state_);
  if (core_.p.thermal.enabled) {
    drivebench::advance(core_.p.thermal, state_.thermal, state_.heat_j, core_.timing.period_s);
    state_.heat_j = 0.0;
    adjust();
  }
  if (core_.tap != nullptr) return;  // no sample is read at gate level
  if (!core_.p.thermal.enabled) look_inside();
  core_.sensors.end_tick(state_.sensors,
                         {.current_a = sensed_currents(),
                          .voltage_v = state_.voltage_v,
                          .bus_v = state_.drive.bus_v,
                          .neutral_v = state_.neutral_v,
                          .temperature_k = state_.thermal.temperature_k,
                          .angle_rad = state_.shaft.angle_rad,
                          .speed_rad_s = state_.shaft.speed_rad_s},
                         tick + 1);
}

void Axis::advance(const PhaseCommand& command, Tick tick) noexcept {
  if ((state_.faults & kDiverged) != 0) return;
  const MotionState before = motion();
  begin_tick(command, tick);
  train_->run(core_, state_, load_at(tick));
  end_tick(before, tick);
}

bool Axis::has_diverged(Axis& first, Axis& second) noexcept {
  if (((first.state_.faults | second.state_.faults) & kDiverged) == 0) return false;
  first.latch(kDiverged);
  second.latch(kDiverged);
  return true;
}

void Axis::end_both(Axis& first, const MotionState& first_before, Axis& second,
                    const MotionState& second_before, Tick tick) noexcept {
  if (first.finite() && second.finite()) {
    first.end_tick(first_before, tick);
    second.end_tick(second_before, tick);
  } else {
    first.hold(first_before);
    second.hold(second_before);
  }
}

void Axis::advance_pair(Axis& first, Axis& second, const PhaseCommand& first_command,
                        const PhaseCommand& second_command, Tick tick) noexcept {
  if (has_diverged(first, second)) return;
  const MotionState first_before = first.motion();
  const MotionState second_before = second.motion();
  first.begin_tick(first_command, tick);
  second.begin_tick(second_command, tick);
  SharedShaft(first.core_, first.state_, *first.train_, second.core_, second.state_, *second.train_)
      .run(first.load_at(tick) + second.load_at(tick));
  end_both(first, first_before, second, second_before, tick);
}

void Axis::advance_on_one_amplifier(Axis& first, Axis& second, const PhaseCommand& command,
                                    Tick tick) noexcept {
  if (has_diverged(first, second)) return;
  const MotionState first_before = first.motion();
  const MotionState second_before = second.motion();
  first.begin_tick(command, tick);
  second.begin_tick(command, tick);
  SharedAmplifier({first.core_, first.state_, *first.train_, first.load_at(tick)},
                  {second.core_, second.state_, *second.train_, second.load_at(tick)}, command, tick)
      .run();
  end_both(first, first_before, second, second_before, tick);
  const std::uint64_t latched = (first.state_.faults | second.state_.faults) & kLatchedFaults;
  first.latch(latched);
  second.latch(latched);
}

bool Axis::finite() const noexcept {
  double size = std::abs(state_.shaft.speed_rad_s) + std::abs(state_.shaft.angle_rad) +
                std::abs(state_.shaft.load_speed_rad_s) + std::abs(state_.shaft.twist_rad) +
                std::abs(state_.drive.bus_v);
  for (const double word : state_.machine)
    size += std::abs(word);
  return size < kEnvelope;  // false for NaN as well
}

Sample Axis::sample(Tick tick) const noexcept {
  Sample s = core_.sensors.readings(state_.sensors, state_.injected, tick);
  s.tick = static_cast<std::uint64_t>(tick);
  s.faults |= state_.faults;
  s.injected = core_.injected_bits;
  s.encoder_count = state_.encoder.count;
  s.encoder_levels = core_.encoder.levels(state_.encoder, state_.injected);
  s.edge_age_s = core_.encoder.edge_age_s(state_.encoder, tick);
  s.edge_period_s = state_.encoder.period_s;
  s.index_count = state_.encoder.index_count;
  s.index_tick = state_.encoder.index_tick;
  s.hall_lines = hall_lines(core_.p.sensors.hall, state_.injected, core_.pole_pairs * state_.shaft.angle_rad);
  const double turns_rad = static_cast<double>(state_.turns) * kTurnRad;
  s.angle_rad = turns_rad + state_.shaft.angle_rad;
  s.speed_rad_s = state_.shaft.speed_rad_s;
  s.torque_nm = truth_.torque_nm;
  s.load_nm = load_at(tick);
  const PhaseValues current_a = terminal_currents(core_.connection, truth_.current_a, state_.open_terminals);
  s.true_i_a_a = current_a.a;
  s.true_i_b_a = current_a.b;
  s.true_i_c_a = current_a.c;
  s.true_i_f_a = current_a.field;
  s.psi_a_wb = truth_.rotor_flux_wb.a;
  s.psi_b_wb = truth_.rotor_flux_wb.b;
  const LoadSide load = load_side(core_.shaft, state_.shaft, turns_rad);
  s.load_angle_rad = load.angle_rad;
  s.load_speed_rad_s = load.speed_rad_s;
  s.load_position_m = load.position_m;
  s.terminal_a_v = state_.terminal_v.a;
  s.terminal_b_v = state_.terminal_v.b;
  s.terminal_c_v = state_.terminal_v.c;
  s.terminal_a_mean_v = state_.terminal_mean_v.a;
  s.terminal_b_mean_v = state_.terminal_mean_v.b;
  s.terminal_c_mean_v = state_.terminal_mean_v.c;
  core_.comparators.read(state_.comparators, tick, s);
  s.encoder_timer = core_.encoder.timer(state_.encoder);
  s.encoder_capture = core_.encoder.capture(state_.encoder);
  if (core_.absolute.enabled()) s.absolute_angle = core_.absolute.read(state_.absolute, state_.sensors.tick);
  if (core_.hall.enabled()) core_.hall.read(state_.hall, tick, s);
  return s;
}

}  // namespace drivebench
