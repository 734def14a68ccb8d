#pragma once

#include <algorithm>
#include <cmath>

#include "plant/axis_parameters.hpp"
#include "plant/math/rotated.hpp"

/// The equations of each kind of machine with a rigid shaft, written out once more without anything else: the
/// floor of a step. Members are named in the step, so that it expands to the straight line of a program by
/// hand.
namespace drivebench::speed {

template <class S, double S::*... kMembers>
struct StraightLine {
  static S moved(const S& x, const S& k, double h) noexcept {
    S result;
    ((result.*kMembers = x.*kMembers + h * (k.*kMembers)), ...);
    return result;
  }
  template <class Machine>
  static S step(const Machine& m, const S& x, double h) noexcept {
    const S k1 = m.slope(x);
    const S k2 = m.slope(moved(x, k1, 0.5 * h));
    const S k3 = m.slope(moved(x, k2, 0.5 * h));
    const S k4 = m.slope(moved(x, k3, h));
    S result;
    ((result.*kMembers =
          x.*kMembers + (h / 6.0) * (k1.*kMembers + k4.*kMembers + 2.0 * (k2.*kMembers + k3.*kMembers))),
     ...);
    return result;
  }
};

struct BareShaft {
  double friction, per_inertia;
  explicit BareShaft(const MechanicsParameters& p)
      : friction(p.viscous_friction_nms), per_inertia(1.0 / p.inertia_kgm2) {}
  double slope(double torque, double w) const noexcept { return (torque - friction * w) * per_inertia; }
};

struct BareInduction {
  struct State {
    double ia, ib, pa, pb, w, angle;
  };
  using Rk4 = StraightLine<State, &State::ia, &State::ib, &State::pa, &State::pb, &State::w, &State::angle>;
  double np, eta, beta, gamma, m, reluctance, torque, ua, ub;
  BareShaft shaft;

  BareInduction(const InductionMachineParameters& p, const MechanicsParameters& s, double u_a, double u_b)
      : np(p.pole_pairs),
        eta(p.rotor_resistance_ohm / p.rotor_inductance_h),
        m(p.mutual_inductance_h),
        ua(u_a),
        ub(u_b),
        shaft(s) {
    const double transient = p.stator_inductance_h - m * m / p.rotor_inductance_h;
    beta = m / (p.rotor_inductance_h * transient);
    gamma = m * eta * beta + p.stator_resistance_ohm / transient;
    reluctance = 1.0 / transient;
    torque = np * m / p.rotor_inductance_h;
  }
  State slope(const State& x) const noexcept {
    const double we = np * x.w;
    return {beta * (eta * x.pa + we * x.pb) - gamma * x.ia + ua * reluctance,
            beta * (eta * x.pb - we * x.pa) - gamma * x.ib + ub * reluctance,
            eta * (m * x.ia - x.pa) - we * x.pb,
            eta * (m * x.ib - x.pb) + we * x.pa,
            shaft.slope(torque * (x.ib * x.pa - x.ia * x.pb), x.w),
            x.w};
  }
};

/// With the curve as a table that is searched from its beginning.
struct BareSaturatedInduction {
  struct State {
    double sa, sb, ra, rb, w, angle;
  };
  using Rk4 = StraightLine<State, &State::sa, &State::sb, &State::ra, &State::rb, &State::w, &State::angle>;
  double np, rs, rr, per_ls, per_lr, per_leakage, ua, ub;
  const std::vector<CurvePoint>& curve;
  BareShaft shaft;

  BareSaturatedInduction(const SaturatedInductionMachineParameters& p, const MechanicsParameters& s,
                         double u_a, double u_b)
      : np(p.pole_pairs),
        rs(p.stator_resistance_ohm),
        rr(p.rotor_resistance_ohm),
        per_ls(1.0 / p.stator_leakage_h),
        per_lr(1.0 / p.rotor_leakage_h),
        per_leakage(per_ls + per_lr),
        ua(u_a),
        ub(u_b),
        curve(p.magnetising_curve.points()),
        shaft(s) {}
  State slope(const State& x) const noexcept {
    const double ta = x.sa * per_ls + x.ra * per_lr, tb = x.sb * per_ls + x.rb * per_lr;
    const double total = std::sqrt(ta * ta + tb * tb);
    std::size_t k = 1;
    while (k + 1 < curve.size() && curve[k].x + curve[k].y * per_leakage < total)
      ++k;
    const CurvePoint& low = curve[k - 1];
    const double rise = (curve[k].x - low.x) / (curve[k].y - low.y);
    const double flux = (total - low.x + rise * low.y) / (rise + per_leakage);
    const double chord = total > 0.0 ? flux / total : 0.0;
    const double fa = chord * ta, fb = chord * tb, we = np * x.w;
    const double isa = (x.sa - fa) * per_ls, isb = (x.sb - fb) * per_ls;
    return {ua - rs * isa,
            ub - rs * isb,
            -rr * (x.ra - fa) * per_lr - we * x.rb,
            -rr * (x.rb - fb) * per_lr + we * x.ra,
            shaft.slope(np * (isb * fa - isa * fb), x.w),
            x.w};
  }
};

/// The electrical angle: a cosine and sine for each step, rotated for its stages, as in the product.
struct BareAngle {
  double np;
  CosSin start{1.0, 0.0};
  double start_rad = 0.0;

  void begin(double angle) noexcept {
    start = cos_sin(np * angle);
    start_rad = angle;
  }
  CosSin at(double angle) const noexcept { return rotated(start, np * (angle - start_rad)); }
};

struct BarePm {
  struct State {
    double ia, ib, w, angle;
  };
  using Rk4 = StraightLine<State, &State::ia, &State::ib, &State::w, &State::angle>;
  double r, per_l, k, ua, ub;
  BareShaft shaft;
  BareAngle angle;

  BarePm(const PmMachineParameters& p, const MechanicsParameters& s, double u_a, double u_b)
      : r(p.stator_resistance_ohm),
        per_l(1.0 / p.inductance_d_h),
        k(p.torque_constant_nm_per_a),
        ua(u_a),
        ub(u_b),
        shaft(s),
        angle{static_cast<double>(p.pole_pairs)} {}
  void begin(const State& x) noexcept { angle.begin(x.angle); }
  State slope(const State& x) const noexcept {
    const auto [c, s] = angle.at(x.angle);
    const double e = k * x.w;
    return {(ua - r * x.ia + e * s) * per_l, (ub - r * x.ib - e * c) * per_l,
            shaft.slope(k * (x.ib * c - x.ia * s), x.w), x.w};
  }
};

struct BareWoundRotor {
  struct State {
    double ia, ib, i_f, w, angle;
  };
  using Rk4 = StraightLine<State, &State::ia, &State::ib, &State::i_f, &State::w, &State::angle>;
  double np, rs, rf, per_ls, m, coupling, per_transient, ua, ub, uf;
  BareShaft shaft;
  BareAngle angle;

  BareWoundRotor(const WoundRotorMachineParameters& p, const MechanicsParameters& s, double u_a, double u_b,
                 double u_f)
      : np(p.pole_pairs),
        rs(p.stator_resistance_ohm),
        rf(p.field_resistance_ohm),
        per_ls(1.0 / p.stator_inductance_h),
        m(p.mutual_inductance_h),
        coupling(m * per_ls),
        per_transient(1.0 / (p.field_inductance_h - coupling * m)),
        ua(u_a),
        ub(u_b),
        uf(u_f),
        shaft(s),
        angle{np} {}
  void begin(const State& x) noexcept { angle.begin(x.angle); }
  State slope(const State& x) const noexcept {
    const auto [c, s] = angle.at(x.angle);
    const double rate = np * x.w * m;
    const double va = ua - rs * x.ia + rate * x.i_f * s, vb = ub - rs * x.ib - rate * x.i_f * c;
    const double iq = x.ib * c - x.ia * s;
    const double vf = uf - rf * x.i_f - rate * iq;
    const double df = (vf - coupling * (c * va + s * vb)) * per_transient;
    return {per_ls * va - coupling * c * df, per_ls * vb - coupling * s * df, df,
            shaft.slope(np * m * x.i_f * iq, x.w), x.w};
  }
};

struct BareBldc {
  struct State {
    double ia, ib, w, angle;
  };
  using Rk4 = StraightLine<State, &State::ia, &State::ib, &State::w, &State::angle>;
  double turns, r, per_l, k, ua, ub;
  BareShaft shaft;

  BareBldc(const BldcMachineParameters& p, const MechanicsParameters& s, double u_a, double u_b)
      : turns(p.pole_pairs / 6.283185307179586),
        r(p.stator_resistance_ohm),
        per_l(1.0 / (p.self_inductance_h + p.mutual_inductance_h)),
        k(p.torque_constant_nm_per_a),
        ua(u_a),
        ub(u_b),
        shaft(s) {}
  static double shape(double t) noexcept {
    const double distance = std::abs(t - static_cast<double>(static_cast<long>(t + (t < 0.0 ? -0.5 : 0.5))));
    return std::min(1.0, std::max(-1.0, 3.0 - 12.0 * distance));
  }
  State slope(const State& x) const noexcept {
    const double t = turns * x.angle - 0.25;
    const double e1 = shape(t), e2 = shape(t - 1.0 / 3.0), e3 = shape(t - 2.0 / 3.0);
    const double ea = 0.816496580927726 * (e1 - 0.5 * (e2 + e3)), eb = 0.7071067811865476 * (e2 - e3);
    return {(ua - r * x.ia + k * x.w * ea) * per_l, (ub - r * x.ib + k * x.w * eb) * per_l,
            shaft.slope(-k * (ea * x.ia + eb * x.ib), x.w), x.w};
  }
};

struct BarePmDc {
  struct State {
    double i, w, angle;
  };
  using Rk4 = StraightLine<State, &State::i, &State::w, &State::angle>;
  double r, per_l, k, u;
  BareShaft shaft;

  BarePmDc(const PmDcMachineParameters& p, const MechanicsParameters& s, double volts)
      : r(p.armature_resistance_ohm),
        per_l(1.0 / p.armature_inductance_h),
        k(p.torque_constant_nm_per_a),
        u(volts),
        shaft(s) {}
  BarePmDc(const LinearDcMachineParameters& p, const MechanicsParameters& s, double volts)
      : r(p.resistance_ohm),
        per_l(1.0 / p.inductance_h),
        k(p.flux_density_t * p.bar_length_m),
        u(volts),
        shaft(s) {}
  State slope(const State& x) const noexcept {
    return {(u - r * x.i - k * x.w) * per_l, shaft.slope(k * x.i, x.w), x.w};
  }
};

/// Separately excited, and shunt with u_f = u.
struct BareFieldDc {
  struct State {
    double i, flux, w, angle;
  };
  using Rk4 = StraightLine<State, &State::i, &State::flux, &State::w, &State::angle>;
  double r, per_l, k, rf, per_lf, u, uf;
  BareShaft shaft;

  State slope(const State& x) const noexcept {
    return {(u - r * x.i - k * x.flux * x.w) * per_l, uf - rf * x.flux * per_lf,
            shaft.slope(k * x.flux * x.i, x.w), x.w};
  }
};

struct BareSeriesDc {
  struct State {
    double linkage, w, angle;
  };
  using Rk4 = StraightLine<State, &State::linkage, &State::w, &State::angle>;
  double r, per_l, share, k, u;
  BareShaft shaft;

  BareSeriesDc(const SeriesDcMachineParameters& p, const MechanicsParameters& s, double volts)
      : r(p.armature_resistance_ohm + p.field_resistance_ohm),
        per_l(1.0 / (p.armature_inductance_h + p.field_inductance_h)),
        share(p.field_inductance_h * per_l),
        k(p.motor_constant),
        u(volts),
        shaft(s) {}
  State slope(const State& x) const noexcept {
    const double i = x.linkage * per_l, flux = x.linkage * share;
    return {u - r * i - k * flux * x.w, shaft.slope(k * flux * i, x.w), x.w};
  }
};

}  // namespace drivebench::speed
