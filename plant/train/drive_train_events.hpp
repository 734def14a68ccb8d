#pragma once

#include "plant/train/drive_train.hpp"

// The events at which a piece of a tick ends.
namespace drivebench {

template <class Machine, class Shaft>
void DriveTrain<Machine, Shaft>::add_electrical(TerminalSet dying, const PhaseValues& current_a,
                                                const RotorMotion& motion, double corner,
                                                EventValues& values) const noexcept {
  if ((dying & 1u) != 0) values.add(current_a.a);
  if ((dying & 2u) != 0) values.add(current_a.b);
  if ((dying & 4u) != 0) values.add(current_a.c);
  if constexpr (Machine::kHasCorners) {
    if (corner != kNoCorner) values.add(corner_position(c_, motion.angle_rad) - corner);
  }
}

template <class Machine, class Shaft>
double DriveTrain<Machine, Shaft>::corner_between(const RotorMotion& from,
                                                  const RotorMotion& to) const noexcept {
  if constexpr (Machine::kHasCorners) {
    return corner_on_the_way(corner_position(c_, from.angle_rad), corner_position(c_, to.angle_rad));
  } else {
    return kNoCorner;
  }
}

template <class Machine, class Shaft>
EventValues DriveTrain<Machine, Shaft>::values_at(const AxisCore& core, TerminalSet dying,
                                                  const PhaseValues& current_a, const Whole& x,
                                                  const ShaftBranch& branch, double load_nm,
                                                  double corner) const noexcept {
  EventValues values;
  if (core.shaft_has_events) {
    std::array<double, 4> shaft{};
    const double driving_nm = is_held(branch) ? torque_nm(c_, x.machine, motion_of(x)) : 0.0;
    values.shaft = event_values(core.shaft, x.shaft, branch, driving_nm, load_nm, shaft);
    for (int k = 0; k < values.shaft; ++k)
      values.add(shaft[static_cast<std::size_t>(k)]);
  }
  add_electrical(dying, current_a, motion_of(x), corner, values);
  return values;
}

template <class Machine, class Shaft>
template <bool kSwitching>
auto DriveTrain<Machine, Shaft>::cut_at_event(AxisCore& core, AxisState& state, const Whole& from, Whole& to,
                                              double start_s, double duration_s, const ShaftBranch& branch,
                                              double load_nm) noexcept -> Cut {
  const TerminalSet dying = piece_.circuit.dying;
  const double corner = corner_between(motion_of(from), motion_of(to));
  if constexpr (kSwitching) piece_.corner = corner;
  const auto found_at = [&](const Whole& x, const PhaseValues& current_a,
                            const PhaseValues& terminal_v) noexcept {
    EventValues found = values_at(core, dying, current_a, x, branch, load_nm, corner);
    if constexpr (kSwitching) add_switching(core, state, x.machine, motion_of(x), terminal_v, found);
    return found;
  };
  PhaseValues end_a{};
  const auto values = [&](const Whole& x) noexcept {
    if constexpr (kSwitching) {
      piece_.knows_end = piece_.turning_on != 0;
      if (piece_.knows_end) piece_.end_v = floating_within(core, x.machine, motion_of(x));
    }
    if (dying != 0) end_a = currents(core, state, x.machine, motion_of(x));
    return found_at(x, end_a, piece_.end_v);
  };
  PhaseValues begun_v{};
  if constexpr (kSwitching) begun_v = first_v(core, from.machine, motion_of(from));
  const EventValues after = values(to);
  const EventValues before = found_at(from, dying_at_start(end_a), begun_v);
  const Crossing crossing = located_event(before, after, [&](double fraction) noexcept {
    const double shorter_s = fraction * duration_s;
    reconnect_piece(core, state, start_s, shorter_s, from.machine, motion_of(from));
    to = from;
    step(core, to, shorter_s, branch, load_nm);
    return values(to);
  });
  Cut cut{.fraction = crossing.fraction};
  if (crossing.event >= before.shaft) {
    cut.electrical_event = crossing.event - before.shaft;
  } else if (crossing.event >= 0) {
    to.shaft = settled(core.shaft, to.shaft, crossing.event);
    cut.freed = freed_by(branch, crossing.event);
  }
  return cut;
}

}  // namespace drivebench
