#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>

#include "clients/identification/data/result.hpp"
#include "clients/identification/data/settings.hpp"
#include "clients/models/bldc_machine.hpp"
#include "clients/models/dc_machine.hpp"
#include "clients/models/salient_pm_machine.hpp"
#include "plant/math/frames.hpp"

/// The motors of the identification methods as differential equations, for re-simulation: parameters as
/// estimated, inputs as measured.
namespace drivebench::identification {

/// The inputs of a model at an instant.
struct MotorInput {
  std::array<double, 3> u{};    ///< [V] a star: against any common point; a two-phase machine or an armature
                                ///< uses the first two or one
  double electrical_rad = 0.0;  ///< the measured angle times the pole pairs
  std::complex<double> direction = 1.0;  ///< e^(j electrical_rad), where Model::kTurns
};

/// A state that the signals show is known to this part of the largest current and speed of the record.
inline constexpr double kKnownPart = 0.05;

/// The two-phase equivalent of a star, or the phases of a two-phase machine, as a complex number; and back.
inline std::complex<double> two_phase_of(const std::array<double, 3>& x, bool three_phase) noexcept {
  if (!three_phase) return {x[0], x[1]};
  const TwoPhase pair = three_to_two({.a = x[0], .b = x[1], .c = x[2]});
  return {pair.a, pair.b};
}
inline std::array<double, 3> phases_of(std::complex<double> x, bool three_phase) noexcept {
  if (!three_phase) return {x.real(), x.imag(), 0.0};
  const ThreePhase phases = two_to_three({.a = x.real(), .b = x.imag()});
  return {phases.a, phases.b, phases.c};
}

/// x as seen from a direction of length 1: x conj(direction).
inline std::complex<double> towards(std::complex<double> direction, std::complex<double> x) noexcept {
  return {x.real() * direction.real() + x.imag() * direction.imag(),
          x.imag() * direction.real() - x.real() * direction.imag()};
}

/// The equations of DcMachineModel.
struct DcModel {
  using State = std::array<double, 2>;  // i, w
  static constexpr std::size_t kSpeed = 1;
  static constexpr bool kTurns = false;  ///< the model needs the direction of its rotor
  DcMachineModel m;

  DcModel(const Result& r, const Settings&)
      : m{.resistance_ohm = r.at("R"),
          .inductance_h = r.at("L"),
          .torque_constant_nm_per_a = r.at("K_T"),
          .inertia_kgm2 = r.at("J"),
          .friction_nms = r.at("f")} {}
  double fastest_rate(double) const noexcept {
    return m.resistance_ohm / m.inductance_h +
           m.torque_constant_nm_per_a / std::sqrt(m.inductance_h * m.inertia_kgm2);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    return {(in.u[0] - m.resistance_ohm * x[0] - m.torque_constant_nm_per_a * x[1]) / m.inductance_h,
            (m.torque_constant_nm_per_a * x[0] - m.friction_nms * x[1]) / m.inertia_kgm2};
  }
  void settle(State&, const State&, double) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return {x[0], 0.0, 0.0};
  }
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    return {i[0], speed};
  }
  State spread(double current_a, double speed_rad_s) const noexcept { return {current_a, speed_rad_s}; }
};

/// In the four numbers that the terminals show, so not those of InductionMotorModel, in the stator's frame,
/// phi = (M/L_R) psi_R:
///   sigma L_S i' = u - sigma L_S gamma i + (1/T_R - j n_p w) phi,   phi' = -(1/T_R - j n_p w) phi +
///   (1 - sigma) L_S/T_R i,   J w' = n_p Im(phi* i) - {f w or tau_L}. Source: the book, (8.4)-(8.6).
struct InductionModel {
  using State = std::array<double, 5>;  // i_alpha, i_beta, phi_alpha, phi_beta, w
  static constexpr std::size_t kSpeed = 4;
  static constexpr bool kTurns = false;
  double transient_h, gamma, rotor_rate, magnetising_h, inertia, friction = 0.0, load = 0.0, pole_pairs;
  double per_transient_h, per_inertia;
  bool three_phase;

  InductionModel(const Result& r, const Settings& e)
      : transient_h(r.at("sigma") * r.at("L_S")),
        gamma((r.at("R_S") + (1.0 - r.at("sigma")) * r.at("L_S") / r.at("T_R")) / transient_h),
        rotor_rate(1.0 / r.at("T_R")),
        magnetising_h((1.0 - r.at("sigma")) * r.at("L_S")),
        inertia(r.at("J")),
        pole_pairs(e.pole_pairs),
        per_transient_h(1.0 / transient_h),
        per_inertia(1.0 / inertia),
        three_phase(e.three_phase) {
    if (const Estimate* f = r.find("f")) friction = f->value;
    if (const Estimate* tau = r.find("tau_L")) load = tau->value;
  }
  double fastest_rate(double speed) const noexcept { return gamma + pole_pairs * std::abs(speed); }
  State slope(const State& x, const MotorInput& in) const noexcept {
    const std::complex<double> u = two_phase_of(in.u, three_phase);
    const double omega_e = pole_pairs * x[4];
    const double decay_a = rotor_rate * x[2] + omega_e * x[3];
    const double decay_b = rotor_rate * x[3] - omega_e * x[2];
    const double torque = pole_pairs * (x[2] * x[1] - x[3] * x[0]);
    return {(u.real() + decay_a) * per_transient_h - gamma * x[0],
            (u.imag() + decay_b) * per_transient_h - gamma * x[1],
            magnetising_h * rotor_rate * x[0] - decay_a, magnetising_h * rotor_rate * x[1] - decay_b,
            (torque - friction * x[4] - load) * per_inertia};
  }
  void settle(State&, const State&, double) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return phases_of({x[0], x[1]}, three_phase);
  }
  /// The state without flux; the caller adds it.
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    const std::complex<double> current = two_phase_of(i, three_phase);
    return {current.real(), current.imag(), 0.0, 0.0, speed};
  }
  /// A flux that the currents could have built up is as likely as none.
  State spread(double current_a, double speed_rad_s) const noexcept {
    const double flux = magnetising_h * current_a / kKnownPart;
    return {current_a, current_a, flux, flux, speed_rad_s};
  }
};

/// The equations of SalientPmModel in the magnet's frame, whose angle is the measured one, with dry friction:
///   J w' = tau(i_d, i_q) - f w - f_c sgn w; at standstill f_c balances smaller torques. A round rotor has
///   L_d = L_q = L_S. Source: the book, (9.104) and problem 9.11.
struct PmModel {
  using State = std::array<double, 3>;  // i_d, i_q, w
  static constexpr std::size_t kSpeed = 2;
  static constexpr bool kTurns = true;
  SalientPmModel m;
  double coulomb_nm;
  double per_d_h, per_q_h, per_inertia;  ///< a division takes as long as five products

  PmModel(const Result& r, const Settings& settings)
      : m{.pole_pairs = static_cast<double>(settings.pole_pairs),
          .resistance_ohm = r.at("R_S"),
          .inductance_d_h = r.at(is_salient(r) ? "L_d" : "L_S"),
          .inductance_q_h = r.at(is_salient(r) ? "L_q" : "L_S"),
          .torque_constant_nm_per_a = r.at("K_m"),
          .friction_nms = r.at("f"),
          .inertia_kgm2 = r.at("J"),
          .star = settings.three_phase},
        coulomb_nm(r.at("f_c")),
        per_d_h(1.0 / m.inductance_d_h),
        per_q_h(1.0 / m.inductance_q_h),
        per_inertia(1.0 / m.inertia_kgm2) {}
  double fastest_rate(double speed) const noexcept {
    const double least_h = std::min(m.inductance_d_h, m.inductance_q_h);
    return m.resistance_ohm / least_h +
           m.pole_pairs * std::abs(speed) *
               std::sqrt(std::max(m.inductance_d_h, m.inductance_q_h) / least_h) +
           m.torque_constant_nm_per_a / std::sqrt(least_h * m.inertia_kgm2);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    const std::complex<double> u = towards(in.direction, two_phase_of(in.u, m.star));
    const double omega_e = m.pole_pairs * x[2];
    return {(u.real() - m.resistance_ohm * x[0] + omega_e * m.inductance_q_h * x[1]) * per_d_h,
            (u.imag() - m.resistance_ohm * x[1] - m.torque_constant_nm_per_a * x[2] -
             omega_e * m.inductance_d_h * x[0]) *
                per_q_h,
            (torque_nm(x) - m.friction_nms * x[2] - friction_torque_nm(x)) * per_inertia};
  }
  /// A shaft that comes to rest within a step of h stays there if friction can hold it, and goes on from rest
  /// for what is left of the step if it cannot: the slopes across the change of sign mix both frictions.
  void settle(State& x, const State& before, double h) const noexcept {
    if (coulomb_nm <= 0.0 || x[2] * before[2] >= 0.0) return;
    const double torque_nm = 0.5 * (m.torque_nm(x[0], x[1]) + m.torque_nm(before[0], before[1]));
    x[2] = 0.0;
    if (std::abs(torque_nm) <= coulomb_nm) return;
    const double braking = (torque_nm - std::copysign(coulomb_nm, before[2])) / m.inertia_kgm2;
    const double left = std::clamp(h + before[2] / braking, 0.0, h);
    x[2] = left * (torque_nm - std::copysign(coulomb_nm, torque_nm)) / m.inertia_kgm2;
  }
  std::array<double, 3> currents(const State& x, const MotorInput& in) const noexcept {
    return phases_of(towards(std::conj(in.direction), {x[0], x[1]}), m.star);
  }
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput& in) const noexcept {
    const std::complex<double> dq = towards(in.direction, two_phase_of(i, m.star));
    return {dq.real(), dq.imag(), speed};
  }
  State spread(double current_a, double speed_rad_s) const noexcept {
    return {current_a, current_a, speed_rad_s};
  }

 private:
  double torque_nm(const State& x) const noexcept {
    return (m.torque_constant_nm_per_a + m.pole_pairs * m.saliency_h() * x[0]) * x[1];
  }
  double friction_torque_nm(const State& x) const noexcept {
    if (x[2] != 0.0) return std::copysign(coulomb_nm, x[2]);
    const double most = std::max(0.0, coulomb_nm);
    return std::clamp(torque_nm(x), -most, most);
  }
};

/// The equations of BldcMachineModel, with e at the measured angle.
struct BldcModel {
  using State = std::array<double, 4>;  // i_a, i_b, i_c, w
  static constexpr std::size_t kSpeed = 3;
  static constexpr bool kTurns = false;
  BldcMachineModel m;
  double per_h, per_inertia;

  BldcModel(const Result& r, const Settings&)
      : m{.pole_pairs = 1.0,
          .resistance_ohm = r.at("R_S"),
          .torque_constant_nm_per_a = r.at("tau_p"),
          .friction_nms = r.at("f"),
          .inertia_kgm2 = r.at("J"),
          .inductance_h = r.at("L+M")},
        per_h(1.0 / m.inductance_h),
        per_inertia(1.0 / m.inertia_kgm2) {}
  double fastest_rate(double) const noexcept {
    return m.resistance_ohm / m.inductance_h +
           2.0 * m.torque_constant_nm_per_a / std::sqrt(m.inductance_h * m.inertia_kgm2);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    constexpr double kThird = 1.0 / 3.0;
    const double turns = in.electrical_rad * (0.5 * std::numbers::inv_pi);
    const std::array<double, 3> e = {trapezoid_at_turns(turns), trapezoid_at_turns(turns - kThird),
                                     trapezoid_at_turns(turns - 2.0 * kThird)};
    const double e_mean = (e[0] + e[1] + e[2]) * kThird;
    const double u_mean = (in.u[0] + in.u[1] + in.u[2]) * kThird;
    State dx{};
    double torque_nm = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double emf_v = m.torque_constant_nm_per_a * x[3] * (e[k] - e_mean);
      dx[k] = (in.u[k] - u_mean - m.resistance_ohm * x[k] + emf_v) * per_h;
      torque_nm -= m.torque_constant_nm_per_a * e[k] * x[k];
    }
    dx[3] = (torque_nm - m.friction_nms * x[3]) * per_inertia;
    return dx;
  }
  void settle(State&, const State&, double) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return {x[0], x[1], x[2]};
  }
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    return {i[0], i[1], i[2], speed};
  }
  State spread(double current_a, double speed_rad_s) const noexcept {
    return {current_a, current_a, current_a, speed_rad_s};
  }
};

}  // namespace drivebench::identification
