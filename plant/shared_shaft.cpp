#include "plant/shared_shaft.hpp"

#include <algorithm>

#include "plant/drive_train.hpp"

namespace drivebench {
namespace {

RotorMotion motion_of(double angle_rad, double speed_rad_s) noexcept {
  return {.angle_rad = angle_rad, .speed_rad_s = speed_rad_s, .electrical = {.cos = 1.0, .sin = 0.0}};
}

template <class Shaft>
RotorMotion first_motion(const Shaft& x) noexcept {
  return motion_of(x.angle_rad, x.speed_rad_s);
}

template <class Shaft>
double output_angle_rad(const AxisCore& core, const Shaft& x) noexcept {
  return load_side(core.shaft, x, 0.0).angle_rad;
}

template <class Shaft>
EventValues shaft_values(const AxisCore& core, const Shaft& x, const ShaftBranch& branch) noexcept {
  EventValues values;
  if (!core.shaft_has_events) return values;
  std::array<double, 4> shaft{};
  values.shaft = event_values(core.shaft, x, branch, shaft);
  for (int k = 0; k < values.shaft; ++k)
    values.add(shaft[static_cast<std::size_t>(k)]);
  return values;
}

}  // namespace

SharedShaft::SharedShaft(AxisCore& first_core, AxisState& first, Train& first_train, AxisCore& second_core,
                         AxisState& second, Train& second_train) noexcept
    : first_{first_core, first, first_train}, second_{second_core, second, second_train} {}

template <class Shaft>
RotorMotion SharedShaft::second_motion(const Shaft& x) const noexcept {
  const LoadSide output = load_side(first_.core.shaft, x, 0.0);
  return motion_of(output.angle_rad - output_start_rad_, output.speed_rad_s);
}

/// One Runge-Kutta step of both machines and the shaft between them.
template <class Shaft>
Shaft SharedShaft::stepped(const Shaft& from, double duration_s, const ShaftBranch& branch,
                           double load_nm) noexcept {
  constexpr std::array<double, 4> kWay{0.5, 0.5, 1.0, 0.0};
  constexpr std::array<double, 4> kWeight{1.0, 2.0, 2.0, 1.0};
  Shaft x = from;
  Shaft sum{};
  for (int k = 0; k < 4; ++k) {
    const auto number = static_cast<std::size_t>(k);
    const RotorMotion first = first_motion(x);
    const RotorMotion second = second_motion(x);
    const double first_nm = first_.train.stage_torque_nm(first);
    const double second_nm = second_.train.stage_torque_nm(second);
    const Shaft slope = derivative(first_.core.shaft, x, first_nm, load_nm - second_nm, branch);
    first_.train.stage(k, duration_s, first);
    second_.train.stage(k, duration_s, second);
    sum = advanced(sum, kWeight[number], slope);
    x = advanced(from, kWay[number] * duration_s, slope);
  }
  return advanced(from, duration_s / 6.0, sum);
}

template <class Shaft>
void SharedShaft::run_piece(Shaft& x, double start_s, double end_s, double load_nm) noexcept {
  const bool blocked = first_.state.injected.blocked_rotor != 0.0;
  for (std::size_t events = 0; start_s < end_s; ++events) {
    double duration_s = end_s - start_s;
    x = locked(first_.core.shaft, x, blocked);
    const Shaft from = x;
    const auto open = [&](double s) noexcept {
      first_.train.open(first_.core, first_.state, start_s, s, first_motion(from));
      second_.train.open(second_.core, second_.state, start_s, s, second_motion(from));
    };
    open(duration_s);
    const double second_nm = second_.train.stage_torque_nm(second_motion(from));
    ShaftBranch branch;
    if (first_.core.shaft_has_events || blocked) {
      branch = branch_of(first_.core.shaft, from, first_.train.stage_torque_nm(first_motion(from)),
                         load_nm - second_nm, blocked);
    }
    x = stepped(from, duration_s, branch, load_nm);
    bool cut = false;
    Crossing crossing;
    double first_event = 1.0;
    double second_event = 1.0;
    if (events < kMaxEvents) {
      crossing =
          first_crossing(shaft_values(first_.core, from, branch), shaft_values(first_.core, x, branch));
      first_event = first_.train.event(first_.core, first_.state, first_motion(from), first_motion(x));
      second_event = second_.train.event(second_.core, second_.state, second_motion(from), second_motion(x));
      const double fraction = std::min({crossing.fraction, first_event, second_event});
      cut = fraction < 1.0;
      if (cut) {
        duration_s *= fraction;
        open(duration_s);
        x = stepped(from, duration_s, branch, load_nm);
        if (crossing.fraction == fraction) x = settled(first_.core.shaft, x, crossing.event);
        first_event = first_event == fraction ? 0.0 : 1.0;
        second_event = second_event == fraction ? 0.0 : 1.0;
      }
    }
    first_.train.close(first_.core, first_.state, start_s, duration_s, first_motion(from), first_motion(x),
                       cut && first_event == 0.0);
    second_.train.close(second_.core, second_.state, start_s, duration_s, second_motion(from),
                        second_motion(x), cut && second_event == 0.0);
    start_s = cut ? start_s + duration_s : end_s;
  }
}

void SharedShaft::check_currents(Side& side, const RotorMotion& motion) noexcept {
  const WindingValues current_a = side.train.truth(side.state, motion).current_a;
  check_over_current(side.core, side.state,
                     terminal_currents(side.core.connection, current_a, side.state.open_terminals));
}

template <class Shaft>
void SharedShaft::run_substeps(double load_nm) noexcept {
  Shaft x;
  if constexpr (std::is_same_v<Shaft, TwoMassState>) {
    x = first_.state.shaft;
  } else {
    x = {.speed_rad_s = first_.state.shaft.speed_rad_s, .angle_rad = first_.state.shaft.angle_rad};
  }
  output_start_rad_ = output_angle_rad(first_.core, x) - second_.state.shaft.angle_rad;
  for (int n = 0; n < first_.core.timing.substeps; ++n) {
    const double end_s = (n + 1) * first_.core.step_s;
    for (double start_s = n * first_.core.step_s; start_s < end_s;) {
      const double stop_s = std::min({end_s, first_.core.drive.next_edge_s(first_.state.drive, start_s),
                                      second_.core.drive.next_edge_s(second_.state.drive, start_s)});
      run_piece(x, start_s, stop_s, load_nm);
      start_s = stop_s;
    }
    check_currents(first_, first_motion(x));
    check_currents(second_, second_motion(x));
  }
  const RotorMotion second = second_motion(x);
  second_.state.shaft.speed_rad_s = second.speed_rad_s;
  second_.state.shaft.angle_rad = second.angle_rad;
  if constexpr (std::is_same_v<Shaft, TwoMassState>) {
    first_.state.shaft = x;
  } else {
    first_.state.shaft.speed_rad_s = x.speed_rad_s;
    first_.state.shaft.angle_rad = x.angle_rad;
  }
}

void SharedShaft::run(double load_nm) noexcept {
  if (has_two_masses(first_.core.p.mechanics)) {
    run_substeps<TwoMassState>(load_nm);
  } else {
    run_substeps<ShaftState>(load_nm);
  }
}

}  // namespace drivebench
