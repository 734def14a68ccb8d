#pragma once

#include "plant/axis.hpp"

namespace drivebench::speed {

/// The servo's equations written out by hand, with nothing but the integration around them: the floor of a
/// tick.
struct BareMotor {
  double pole_pairs, eta, beta, gamma, mutual, reluctance, torque, friction, per_inertia;

  explicit BareMotor(const AxisParameters& p) {
    const InductionMachineConstants c = constants_of(p.machine);
    pole_pairs = c.pole_pairs;
    eta = c.eta_per_s;
    beta = c.beta_per_h;
    gamma = c.gamma_per_s;
    mutual = c.mutual_inductance_h;
    reluctance = c.transient_reluctance_per_h;
    torque = c.torque_constant;
    friction = p.mechanics.viscous_friction_nms;
    per_inertia = 1.0 / p.mechanics.inertia_kgm2;
  }
};

struct BareState {
  double ia, ib, pa, pb, w, angle;
};

inline BareState slope(const BareMotor& m, const BareState& x, double ua, double ub) noexcept {
  const double we = m.pole_pairs * x.w;
  const double tau = m.torque * (x.ib * x.pa - x.ia * x.pb);
  return {m.beta * (m.eta * x.pa + we * x.pb) - m.gamma * x.ia + ua * m.reluctance,
          m.beta * (m.eta * x.pb - we * x.pa) - m.gamma * x.ib + ub * m.reluctance,
          m.eta * (m.mutual * x.ia - x.pa) - we * x.pb,
          m.eta * (m.mutual * x.ib - x.pb) + we * x.pa,
          (tau - m.friction * x.w) * m.per_inertia,
          x.w};
}

inline BareState bare_step(const BareMotor& m, const BareState& x, double ua, double ub, double h) noexcept {
  const BareState k1 = slope(m, x, ua, ub);
  const double half = 0.5 * h;
  const BareState x2{x.ia + half * k1.ia, x.ib + half * k1.ib, x.pa + half * k1.pa,
                     x.pb + half * k1.pb, x.w + half * k1.w,   x.angle + half * k1.angle};
  const BareState k2 = slope(m, x2, ua, ub);
  const BareState x3{x.ia + half * k2.ia, x.ib + half * k2.ib, x.pa + half * k2.pa,
                     x.pb + half * k2.pb, x.w + half * k2.w,   x.angle + half * k2.angle};
  const BareState k3 = slope(m, x3, ua, ub);
  const BareState x4{x.ia + h * k3.ia, x.ib + h * k3.ib, x.pa + h * k3.pa,
                     x.pb + h * k3.pb, x.w + h * k3.w,   x.angle + h * k3.angle};
  const BareState k4 = slope(m, x4, ua, ub);
  const double sixth = h / 6.0;
  return {x.ia + sixth * (k1.ia + k4.ia + 2.0 * (k2.ia + k3.ia)),
          x.ib + sixth * (k1.ib + k4.ib + 2.0 * (k2.ib + k3.ib)),
          x.pa + sixth * (k1.pa + k4.pa + 2.0 * (k2.pa + k3.pa)),
          x.pb + sixth * (k1.pb + k4.pb + 2.0 * (k2.pb + k3.pb)),
          x.w + sixth * (k1.w + k4.w + 2.0 * (k2.w + k3.w)),
          x.angle + sixth * (k1.angle + k4.angle + 2.0 * (k2.angle + k3.angle))};
}

}  // namespace drivebench::speed
