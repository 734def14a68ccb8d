#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "plant/math/curve.hpp"

namespace drivebench {

/// The cause of the motion of the shaft.
enum class ShaftMotion : std::int64_t {
  kFree,     ///< the torques
  kLocked,   ///< nothing: it stands
  kImposed,  ///< a prime mover: it goes to its speed whatever the torque
};

/// Section [axis.mechanics]: what the machine turns. The gear lies between the rotor and the load; load
/// quantities are those of the output. A screw makes the output a table that goes screw_lead_m per turn: a
/// table of mass m is a load inertia of m (lead/2 pi)^2, a force F on it a load torque of F lead/2 pi.
struct MechanicsParameters {
  double inertia_kgm2 = 0.0;  ///< of the rotor; without a shaft stiffness with all that is rigid on it
  double viscous_friction_nms = 0.0;       ///< [N·m·s/rad]
  double coulomb_friction_nm = 0.0;        ///< opposes motion
  double static_friction_nm = 0.0;         ///< holds a shaft that stands; at least the Coulomb friction
  double fan_torque_nms2 = 0.0;            ///< passive load k w|w| at the output [N·m·s^2/rad^2]
  double passive_load_nm = 0.0;            ///< load at the output that opposes motion and holds at standstill
  double gear_ratio = 1.0;                 ///< turns of the motor for one of the output
  double load_inertia_kgm2 = 0.0;          ///< at the output
  double load_viscous_friction_nms = 0.0;  ///< at the output
  double shaft_stiffness_nm = 0.0;         ///< of the output shaft [N·m/rad]; 0: rigid
  double shaft_damping_nms = 0.0;          ///< [N·m·s/rad]
  double backlash_rad = 0.0;               ///< free play at the output, whole width
  double screw_lead_m = 0.0;               ///< way of the table for one turn of the output; 0: no table
  ShaftMotion motion = ShaftMotion::kFree;
  double imposed_speed_rad_s = 0.0;
  double imposed_acceleration_rad_s2 = 1e6;
  Curve load_profile{};  ///< load torque [N·m] over time [s]; beyond its ends the end value
};

/// Whether rotor and load turn on an elastic shaft (TwoMassState) and not as one (ShaftState).
bool has_two_masses(const MechanicsParameters& p) noexcept;
/// Whether the branch may differ from a default ShaftBranch, and end: dry friction, passive load, backlash,
/// lock, prime mover. The fault blocked_rotor comes on top.
bool has_events(const MechanicsParameters& p) noexcept;
/// The load torque of the profile at a time since tick 0.
double profile_load_nm(const MechanicsParameters& p, double time_s) noexcept;
/// One over the fastest rate of the mechanics, infinity if there is none: sets the substep.
double fastest_time_constant_s(const MechanicsParameters& p) noexcept;

/// The constants that the equations use, derived once from the parameters.
struct ShaftConstants {
  // The rotor; of a rigid shaft all that turns, seen from the rotor: J1 + J2/n^2, f1 + f2/n^2.
  double inertia_kgm2 = 0.0;
  double per_inertia = 0.0;   ///< [1/(kg·m^2)]
  double friction_nms = 0.0;  ///< [N·m·s/rad]
  double fan_nms2 = 0.0;      ///< [N·m·s^2/rad^2]
  double dry_nm = 0.0;        ///< opposes motion
  double hold_nm = 0.0;       ///< holds at standstill
  double per_ratio = 1.0;     ///< 1/n
  // The load, where it has a state of its own.
  double load_inertia_kgm2 = 0.0;
  double load_per_inertia = 0.0;
  double load_friction_nms = 0.0;
  double load_fan_nms2 = 0.0;
  double load_dry_nm = 0.0;
  double stiffness_nm = 0.0;  ///< [N·m/rad]
  double damping_nms = 0.0;   ///< [N·m·s/rad]
  double half_backlash_rad = 0.0;
  ShaftMotion motion = ShaftMotion::kFree;
  double imposed_speed_rad_s = 0.0;
  double imposed_acceleration_rad_s2 = 0.0;
  double lead_m_per_rad = 0.0;
};

/// The constants of mechanics whose parameters are free of problems().
ShaftConstants constants_of(const MechanicsParameters& p) noexcept;

/// The rotor's side: speed and angle, positive from phase a to phase b.
struct ShaftState {
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;  ///< within the present turn; the axis counts whole turns
};

/// Rotor and load on an elastic shaft.
struct TwoMassState {
  double speed_rad_s = 0.0;       ///< of the rotor
  double angle_rad = 0.0;         ///< of the rotor, within the present turn
  double load_speed_rad_s = 0.0;  ///< of the output
  double twist_rad = 0.0;         ///< angle of the rotor over the gear ratio less that of the output
};

/// The branch of the laws of friction, prime mover and backlash that holds, constant between two events. The
/// default is that of a free shaft without dry friction and backlash.
struct ShaftBranch {
  double turns = 1.0;                ///< 1: the torques act, 0: stiction, lock or prime mover hold the speed
  double direction = 0.0;            ///< sign of the motion that dry friction opposes
  double acceleration_rad_s2 = 0.0;  ///< of the prime mover
  double contact_rad =
      0.0;               ///< two masses: the twist at which the shaft begins to bear; within the backlash 0
  double contact = 1.0;  ///< two masses: 1: the teeth touch, 0: they are apart
  double load_turns = 1.0;  ///< two masses: 0: the load stands against its passive torque
  double load_direction = 0.0;
  double held_nm = 0.0;       ///< static friction that holds the rotor, which stands; 0: none does
  double load_held_nm = 0.0;  ///< the same of the load
};

/// Masses whose static friction the torques have just overcome: it does not hold them any more.
struct Freed {
  bool rotor = false;
  bool load = false;
};

/// The output of the gear, and the table of a screw.
struct LoadSide {
  double angle_rad;
  double speed_rad_s;
  double position_m;
};

namespace shaft_detail {

constexpr double sign_of(double x) noexcept {
  return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0);
}

/// The part of the branch that concerns the rotor, under all torques on it but its own friction.
inline ShaftBranch rotor_branch(const ShaftConstants& c, double speed_rad_s, double driving_nm, bool blocked,
                                bool freed) noexcept {
  if (blocked || c.motion == ShaftMotion::kLocked) return {.turns = 0.0};
  if (c.motion == ShaftMotion::kImposed) {
    return {
        .turns = 0.0,
        .direction = sign_of(speed_rad_s),
        .acceleration_rad_s2 = c.imposed_acceleration_rad_s2 * sign_of(c.imposed_speed_rad_s - speed_rad_s)};
  }
  if (c.hold_nm == 0.0) return {};
  if (speed_rad_s != 0.0) return {.direction = sign_of(speed_rad_s)};
  if (!freed && std::abs(driving_nm) <= c.hold_nm) return {.turns = 0.0, .held_nm = c.hold_nm};
  return {.direction = sign_of(driving_nm)};
}

/// The speed at which the branch of the rotor ends.
inline double ending_speed_rad_s(const ShaftConstants& c) noexcept {
  return c.motion == ShaftMotion::kImposed ? c.imposed_speed_rad_s : 0.0;
}

}  // namespace shaft_detail

/// A locked or blocked rotor stands from now on, where it is; its kinetic energy is lost in the lock. To be
/// applied before branch_of() whenever the lock may have closed. A blocked output stands likewise.
constexpr ShaftState locked(const ShaftConstants& c, ShaftState x, bool blocked,
                            bool output_blocked = false) noexcept {
  if (blocked || output_blocked || c.motion == ShaftMotion::kLocked) x.speed_rad_s = 0.0;
  return x;
}
constexpr TwoMassState locked(const ShaftConstants& c, TwoMassState x, bool blocked,
                              bool output_blocked = false) noexcept {
  if (blocked || c.motion == ShaftMotion::kLocked) x.speed_rad_s = 0.0;
  if (output_blocked) x.load_speed_rad_s = 0.0;
  return x;
}

/// An impulse [N·m·s] on the rotor: its speed jumps. Prime mover and lock do not notice.
template <class State>
constexpr State bumped(const ShaftConstants& c, State x, double impulse_nms) noexcept {
  if (c.motion == ShaftMotion::kFree) x.speed_rad_s += impulse_nms * c.per_inertia;
  return x;
}

/// An impulse on the output: a rigid shaft feels it through the gear, the load of an elastic one alone.
constexpr ShaftState output_bumped(const ShaftConstants& c, const ShaftState& x,
                                   double impulse_nms) noexcept {
  return bumped(c, x, c.per_ratio * impulse_nms);
}
constexpr TwoMassState output_bumped(const ShaftConstants& c, TwoMassState x, double impulse_nms) noexcept {
  x.load_speed_rad_s += impulse_nms * c.load_per_inertia;
  return x;
}

/// The branch of a rigid shaft under the torque of the machine and the active load at the output.
inline ShaftBranch branch_of(const ShaftConstants& c, const ShaftState& x, double driving_nm, double load_nm,
                             bool blocked, bool output_blocked = false, Freed freed = {}) noexcept {
  return shaft_detail::rotor_branch(c, x.speed_rad_s, driving_nm - c.per_ratio * load_nm,
                                    blocked || output_blocked, freed.rotor);
}

/// A gear train without play on a rigid shaft, with n turns of the motor for one of the output:
///   tau = (J1 + J2/n^2) w' + (f1 + f2/n^2) w + tau_dry sign(w) + (k/n^3) w|w| + tau_L/n
/// tau_dry is the Coulomb friction of the rotor plus the passive load over n. The active load tau_L keeps its
/// sign when the motion reverses, like a hanging mass. A prime mover imposes w' = +-its acceleration.
/// Source: the book, (1.34), (2.1), (9.104).
inline ShaftState derivative(const ShaftConstants& c, const ShaftState& x, double torque_nm, double load_nm,
                             const ShaftBranch& branch) noexcept {
  // Both are the same in all stages of a step: the compiler works them out once.
  const double opposing_nm = c.per_ratio * load_nm + c.dry_nm * branch.direction;
  const double gain = branch.turns * c.per_inertia;
  const double fan_nms = c.fan_nms2 * x.speed_rad_s;
  const double friction_nm = c.friction_nms * x.speed_rad_s + fan_nms * std::abs(x.speed_rad_s);
  const double net_nm = torque_nm - opposing_nm - friction_nm;
  return {.speed_rad_s = gain * net_nm + branch.acceleration_rad_s2, .angle_rad = x.speed_rad_s};
}

/// Whether event_values() needs the torques: of a shaft that turns they end nothing.
inline bool is_held(const ShaftBranch& branch) noexcept {
  return branch.held_nm > 0.0 || branch.load_held_nm > 0.0;
}

/// Numbers that end the branch when they pass zero, and how many there are. A value that starts at zero ends
/// nothing. Here: the speed, less that of the prime mover; of a held shaft the static friction less the
/// torque that it takes up.
inline int event_values(const ShaftConstants& c, const ShaftState& x, const ShaftBranch& branch,
                        double driving_nm, double load_nm, std::array<double, 4>& values) noexcept {
  values[0] = branch.held_nm > 0.0 ? branch.held_nm - std::abs(driving_nm - c.per_ratio * load_nm)
                                   : x.speed_rad_s - shaft_detail::ending_speed_rad_s(c);
  return c.hold_nm > 0.0 || c.motion == ShaftMotion::kImposed ? 1 : 0;
}

/// The masses that this event frees; the first two events are those of rotor and load.
constexpr Freed freed_by(const ShaftBranch& branch, int event) noexcept {
  return {.rotor = event == 0 && branch.held_nm > 0.0, .load = event == 1 && branch.load_held_nm > 0.0};
}

/// The state with the quantity of this event exactly where it ends the branch.
inline ShaftState settled(const ShaftConstants& c, const ShaftState& x, int) noexcept {
  return {.speed_rad_s = shaft_detail::ending_speed_rad_s(c), .angle_rad = x.angle_rad};
}

/// Output and table, `turns_rad` being the whole turns of the rotor.
LoadSide load_side(const ShaftConstants& c, const ShaftState& x, double turns_rad) noexcept;
double energy_j(const ShaftConstants& c, const ShaftState& x) noexcept;  ///< kinetic
/// The power that friction, fan and passive load dissipate.
double losses_w(const ShaftConstants& c, const ShaftState& x, const ShaftBranch& branch) noexcept;

/// The torque that the elastic shaft gives to the load: K (twist - contact) + D twist' while the teeth touch.
inline double shaft_torque_nm(const ShaftConstants& c, const TwoMassState& x,
                              const ShaftBranch& branch) noexcept {
  const double twist_speed_rad_s = c.per_ratio * x.speed_rad_s - x.load_speed_rad_s;
  return branch.contact *
         (c.stiffness_nm * (x.twist_rad - branch.contact_rad) + c.damping_nms * twist_speed_rad_s);
}

/// The branch of two masses. The teeth only push: they part where spring and damper together would begin to
/// pull, and the twist that the shaft still has then is lost in its damping. They meet again at either end of
/// the backlash, or sooner where the shaft has not yet sprung back.
ShaftBranch branch_of(const ShaftConstants& c, const TwoMassState& x, double driving_nm, double load_nm,
                      bool blocked, bool output_blocked = false, Freed freed = {}) noexcept;

/// Rotor and load on an elastic shaft behind the gear, in motor convention:
///   J1 w1' = tau - f1 w1 - tau_C sign(w1) - tau_s/n
///   J2 w2' = tau_s - f2 w2 - k w2|w2| - tau_P sign(w2) - tau_L
///   twist' = w1/n - w2
///   tau_s  = K (twist -+ backlash/2) + D twist'   while the teeth touch, else 0
/// The shaft has no mass; its first mode alone is modelled.
inline TwoMassState derivative(const ShaftConstants& c, const TwoMassState& x, double torque_nm,
                               double load_nm, const ShaftBranch& branch) noexcept {
  const double shaft_nm = shaft_torque_nm(c, x, branch);
  const double rotor_nm =
      torque_nm - c.per_ratio * shaft_nm - c.friction_nms * x.speed_rad_s - c.dry_nm * branch.direction;
  const double friction_nms = c.load_friction_nms + c.load_fan_nms2 * std::abs(x.load_speed_rad_s);
  const double output_nm =
      shaft_nm - load_nm - friction_nms * x.load_speed_rad_s - c.load_dry_nm * branch.load_direction;
  return {.speed_rad_s = branch.turns * rotor_nm * c.per_inertia + branch.acceleration_rad_s2,
          .angle_rad = x.speed_rad_s,
          .load_speed_rad_s = branch.load_turns * output_nm * c.load_per_inertia,
          .twist_rad = c.per_ratio * x.speed_rad_s - x.load_speed_rad_s};
}

/// As for a rigid shaft, of two masses: of the rotor, of the load, and two numbers that tell when the teeth
/// meet or part.
int event_values(const ShaftConstants& c, const TwoMassState& x, const ShaftBranch& branch, double driving_nm,
                 double load_nm, std::array<double, 4>& values) noexcept;
TwoMassState settled(const ShaftConstants& c, const TwoMassState& x, int event) noexcept;

LoadSide load_side(const ShaftConstants& c, const TwoMassState& x, double turns_rad) noexcept;
double energy_j(const ShaftConstants& c, const TwoMassState& x) noexcept;  ///< kinetic, and of the twist
double losses_w(const ShaftConstants& c, const TwoMassState& x, const ShaftBranch& branch) noexcept;

}  // namespace drivebench
