#include "plant/train/shared_shaft.hpp"

#include <algorithm>

#include "plant/train/drive_train.hpp"

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
    const Torques torques = torques_at(PieceEnd::kNow, x, load_nm);
    const Shaft slope = derivative(first_.core.shaft, x, torques.driving_nm, torques.output_nm, branch);
    first_.train.stage(k, duration_s, first_motion(x));
    second_.train.stage(k, duration_s, second_motion(x));
    sum = advanced(sum, kWeight[number], slope);
    x = advanced(from, kWay[number] * duration_s, slope);
  }
  return advanced(from, duration_s / 6.0, sum);
}

/// The torques of the first machine, and of the load and the second machine, whose rotor is the output.
template <class Shaft>
auto SharedShaft::torques_at(PieceEnd end, const Shaft& x, double load_nm) const noexcept -> Torques {
  return {.driving_nm = first_.train.torque_nm_at(end, first_motion(x)),
          .output_nm = load_nm - second_.train.torque_nm_at(end, second_motion(x))};
}

/// The events that may end a piece: of the shaft, then of the first machine, then of the second.
template <class Shaft>
auto SharedShaft::events_at(PieceEnd end, const Shaft& x, const ShaftBranch& branch,
                            double load_nm) const noexcept -> Events {
  Events events;
  EventValues& values = events.values;
  if (first_.core.shaft_has_events) {
    std::array<double, 4> shaft{};
    const Torques torques = is_held(branch) ? torques_at(end, x, load_nm) : Torques{};
    values.shaft = event_values(first_.core.shaft, x, branch, torques.driving_nm, torques.output_nm, shaft);
    for (int k = 0; k < values.shaft; ++k)
      values.add(shaft[static_cast<std::size_t>(k)]);
  }
  first_.train.add_events(first_.core, first_.state, end, first_motion(x), values);
  events.second = values.count;
  second_.train.add_events(second_.core, second_.state, end, second_motion(x), values);
  return events;
}

/// The step up to the event that comes first.
template <class Shaft>
auto SharedShaft::cut_at_event(const Shaft& from, Shaft& x, double start_s, double duration_s,
                               const ShaftBranch& branch, double load_nm) noexcept -> Cut {
  first_.train.find_corner(first_motion(from), first_motion(x));
  second_.train.find_corner(second_motion(from), second_motion(x));
  const Events before = events_at(PieceEnd::kStart, from, branch, load_nm);
  const EventValues after = events_at(PieceEnd::kNow, x, branch, load_nm).values;
  const Crossing crossing = located_event(before.values, after, [&](double fraction) noexcept {
    const double shorter_s = fraction * duration_s;
    first_.train.shorten(first_.core, first_.state, start_s, shorter_s, first_motion(from));
    second_.train.shorten(second_.core, second_.state, start_s, shorter_s, second_motion(from));
    x = stepped(from, shorter_s, branch, load_nm);
    return events_at(PieceEnd::kNow, x, branch, load_nm).values;
  });
  Cut cut{.fraction = crossing.fraction};
  if (crossing.event >= before.second) {
    cut.second_event = crossing.event - before.second;
  } else if (crossing.event >= before.values.shaft) {
    cut.first_event = crossing.event - before.values.shaft;
  } else if (crossing.event >= 0) {
    x = settled(first_.core.shaft, x, crossing.event);
    cut.freed = freed_by(branch, crossing.event);
  }
  return cut;
}

/// The branch of the shaft where both trains have opened a piece.
template <class Shaft>
ShaftBranch SharedShaft::branch_at(const Shaft& x, double load_nm, Freed freed) const noexcept {
  if (!first_.core.shaft_has_events && !is_blocked(first_) && !is_blocked(second_)) return {};
  const Torques torques = torques_at(PieceEnd::kStart, x, load_nm);
  return branch_of(first_.core.shaft, x, torques.driving_nm, torques.output_nm, is_blocked(first_),
                   is_blocked(second_), freed);
}

template <class Shaft>
void SharedShaft::run_piece(Shaft& x, double start_s, double end_s, double load_nm) noexcept {
  Freed freed;
  for (std::size_t events = 0; start_s < end_s; ++events) {
    meet_break_of(first_, start_s, first_motion(x));
    meet_break_of(second_, start_s, second_motion(x));
    for (Side* const side : {&first_, &second_}) {
      if (side->core.bootstrap.used()) meet_bootstrap(side->core, side->state, start_s);
    }
    const double stop_s = piece_stop_s(first_.core, first_.state, start_s,
                                       piece_stop_s(second_.core, second_.state, start_s, end_s));
    const double duration_s = stop_s - start_s;
    x = locked(first_.core.shaft, x, is_blocked(first_), is_blocked(second_));
    const Shaft from = x;
    first_.train.open(first_.core, first_.state, start_s, duration_s, first_motion(from), events == 0);
    second_.train.open(second_.core, second_.state, start_s, duration_s, second_motion(from), events == 0);
    const ShaftBranch branch = branch_at(from, load_nm, freed);
    x = stepped(from, duration_s, branch, load_nm);
    Cut cut;
    if (events < kMaxEvents) cut = cut_at_event(from, x, start_s, duration_s, branch, load_nm);
    freed = cut.freed;
    const double passed_s = cut.fraction < 1.0 ? cut.fraction * duration_s : duration_s;
    first_.train.close(first_.core, first_.state, start_s, passed_s, first_motion(from), first_motion(x),
                       cut.first_event);
    second_.train.close(second_.core, second_.state, start_s, passed_s, second_motion(from), second_motion(x),
                        cut.second_event);
    start_s = cut.fraction < 1.0 ? start_s + passed_s : stop_s;
  }
}

void SharedShaft::meet_break_of(Side& side, double now_s, const RotorMotion& motion) noexcept {
  if (!side.core.breaks) return;
  const WindingValues current_a = side.train.truth(side.state, motion).current_a;
  meet_break(side.core, side.state, now_s,
             terminal_currents(side.core.connection, current_a, side.state.open_terminals));
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
