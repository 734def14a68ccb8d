#pragma once

#include <cmath>

#include "plant/math/curve.hpp"
#include "tests/plant/power_balance.hpp"

/// A machine on a plain shaft, with meters for the energies: what tests integrate.
namespace drivebench {

struct RigShaft {
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;
};

struct RigEnergy {
  double drawn_j = 0.0;   ///< at all windings
  double copper_j = 0.0;  ///< losses of the machine
  double friction_j = 0.0;
};

template <class State>
struct Rig {
  State machine{};
  RigShaft shaft{};
  RigEnergy energy{};
};

struct ShaftLoad {
  double inertia_kgm2;
  double friction_nms = 0.0;
  double load_nm = 0.0;
};

inline RotorMotion motion_of(const RigShaft& shaft) {
  return {.angle_rad = shaft.angle_rad, .speed_rad_s = shaft.speed_rad_s, .electrical = {1.0, 0.0}};
}

inline TerminalInput voltage(double armature_v, double field_v = 0.0) {
  TerminalInput u;
  u.voltage_v.a = armature_v;
  u.field_v = field_v;
  return u;
}

inline TerminalInput open_terminals(double field_v = 0.0) {
  TerminalInput u = voltage(0.0, field_v);
  u.conduction = Conduction::kNone;
  return u;
}

template <class Constants, class State>
void step(Rig<State>& rig, double step_s, const Constants& c, const TerminalInput& u, const ShaftLoad& load) {
  rig = rk4_step(rig, step_s, [&](const Rig<State>& x) noexcept -> Rig<State> {
    const RotorMotion motion = motion_at(c, x.shaft.angle_rad, x.shaft.speed_rad_s);
    const double torque = torque_nm(c, x.machine, motion);
    return {.machine = derivative(c, x.machine, motion, u),
            .shaft = {(torque - load.friction_nms * motion.speed_rad_s - load.load_nm) / load.inertia_kgm2,
                      motion.speed_rad_s},
            .energy = {input_w(c, x.machine, motion, u), losses_w(c, x.machine, motion),
                       load.friction_nms * motion.speed_rad_s * motion.speed_rad_s}};
  });
}

/// The energy that went in, less the losses and the energy in windings and shaft: constant if energy is
/// conserved. Without a load.
template <class Constants, class State>
double unaccounted_j(const Rig<State>& rig, const Constants& c, const ShaftLoad& load) {
  const double speed_rad_s = rig.shaft.speed_rad_s;
  return rig.energy.drawn_j - rig.energy.copper_j - rig.energy.friction_j -
         stored_energy_j(c, rig.machine, motion_at(c, rig.shaft.angle_rad, speed_rad_s)) -
         0.5 * load.inertia_kgm2 * speed_rad_s * speed_rad_s;
}

template <class Constants, class State>
void run(Rig<State>& rig, double duration_s, double step_s, const Constants& c, const TerminalInput& u,
         const ShaftLoad& load) {
  const long steps = std::lround(duration_s / step_s);
  for (long k = 0; k < steps; ++k)
    step(rig, step_s, c, u, load);
}

/// A field that saturates, in a machine for 240 V and 2 A of field current.
inline Curve wound_saturation() {
  return Curve({{0.0, 0.0}, {0.5, 16.0}, {1.0, 28.0}, {1.5, 36.0}, {2.4, 44.0}, {4.0, 50.0}});
}

/// A shaft so heavy that it keeps its speed.
inline constexpr ShaftLoad kFlywheel{.inertia_kgm2 = 1e30};

}  // namespace drivebench
