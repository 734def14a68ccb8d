#pragma once

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>

#include "clients/identification/motors/bldc_motor.hpp"
#include "clients/identification/result.hpp"

/// The motors of the identification methods as differential equations, for re-simulation: parameters as
/// estimated, inputs as measured.
namespace drivebench::identification {

/// What a model is driven by at an instant.
struct MotorInput {
  std::array<double, 3> u{};    ///< [V] a star: against any common point; a two-phase machine or an armature
                                ///< uses the first two or one
  double electrical_rad = 0.0;  ///< the measured angle times the pole pairs
};

/// Amplitudes of a power-invariant transform of three phases; of a two-phase machine as they are. Tag P3-02.
inline std::complex<double> two_phase_of(const std::array<double, 3>& x, bool three_phase) noexcept {
  if (!three_phase) return {x[0], x[1]};
  return {std::sqrt(2.0 / 3.0) * (x[0] - 0.5 * (x[1] + x[2])), std::sqrt(0.5) * (x[1] - x[2])};
}
inline std::array<double, 3> phases_of(std::complex<double> x, bool three_phase) noexcept {
  if (!three_phase) return {x.real(), x.imag(), 0.0};
  const double a = std::sqrt(2.0 / 3.0) * x.real();
  const double b = std::sqrt(0.5) * x.imag();
  return {a, b - 0.5 * a, -b - 0.5 * a};
}

/// L i' + R i + K_T w = u,   J w' + f w = K_T i. Source: Chiasson 2005, 2.7.
struct DcModel {
  using State = std::array<double, 2>;  // i, w
  static constexpr std::size_t kSpeed = 1;
  double resistance, inductance, constant, inertia, friction;

  explicit DcModel(const Result& r)
      : resistance(r.at("R")),
        inductance(r.at("L")),
        constant(r.at("K_T")),
        inertia(r.at("J")),
        friction(r.at("f")) {}
  double fastest_rate(double) const noexcept {
    return resistance / inductance + constant / std::sqrt(inductance * inertia);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    return {(in.u[0] - resistance * x[0] - constant * x[1]) / inductance,
            (constant * x[0] - friction * x[1]) / inertia};
  }
  void settle(State&, const State&) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return {x[0], 0.0, 0.0};
  }
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    return {i[0], speed};
  }
};

/// In the stator's frame, phi = (M/L_R) psi_R:
///   sigma L_S i' = u - sigma L_S gamma i + (1/T_R - j n_p w) phi,   phi' = -(1/T_R - j n_p w) phi +
///   (1 - sigma) L_S/T_R i,   J w' = n_p Im(phi* i) - {f w or tau_L}. Source: Chiasson 2005, (8.4)-(8.6).
struct InductionModel {
  using State = std::array<double, 5>;  // i_alpha, i_beta, phi_alpha, phi_beta, w
  static constexpr std::size_t kSpeed = 4;
  double transient_h, gamma, rotor_rate, magnetising_h, inertia, friction = 0.0, load = 0.0, pole_pairs;
  bool three_phase;

  InductionModel(const Result& r, const Experiment& e)
      : transient_h(r.at("sigma") * r.at("L_S")),
        gamma((r.at("R_S") + (1.0 - r.at("sigma")) * r.at("L_S") / r.at("T_R")) / transient_h),
        rotor_rate(1.0 / r.at("T_R")),
        magnetising_h((1.0 - r.at("sigma")) * r.at("L_S")),
        inertia(r.at("J")),
        pole_pairs(e.pole_pairs),
        three_phase(e.three_phase) {
    if (const Estimate* f = r.find("f")) friction = f->value;
    if (const Estimate* tau = r.find("tau_L")) load = tau->value;
  }
  double fastest_rate(double speed) const noexcept { return gamma + pole_pairs * std::abs(speed); }
  State slope(const State& x, const MotorInput& in) const noexcept {
    const std::complex<double> i(x[0], x[1]);
    const std::complex<double> phi(x[2], x[3]);
    const std::complex<double> decay = std::complex<double>(rotor_rate, -pole_pairs * x[4]) * phi;
    const std::complex<double> di = (two_phase_of(in.u, three_phase) + decay) / transient_h - gamma * i;
    const std::complex<double> dphi = magnetising_h * rotor_rate * i - decay;
    const double torque = pole_pairs * (x[2] * x[1] - x[3] * x[0]);
    return {di.real(), di.imag(), dphi.real(), dphi.imag(), (torque - friction * x[4] - load) / inertia};
  }
  void settle(State&, const State&) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return phases_of({x[0], x[1]}, three_phase);
  }
  /// Without flux; the caller puts it in.
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    const std::complex<double> current = two_phase_of(i, three_phase);
    return {current.real(), current.imag(), 0.0, 0.0, speed};
  }
};

/// In the magnet's frame, whose angle is the measured one:
///   L i_d' = u_d - R i_d + n_p w L i_q,   L i_q' = u_q - R i_q - n_p w L i_d - K_m w,
///   J w' = K_m i_q - f w - f_c sgn w; at standstill f_c holds what is smaller. Source: Chiasson 2005,
///   (9.104).
struct PmModel {
  using State = std::array<double, 3>;  // i_d, i_q, w
  static constexpr std::size_t kSpeed = 2;
  double resistance, inductance, constant, inertia, friction, coulomb, pole_pairs;
  bool three_phase;

  PmModel(const Result& r, const Experiment& e)
      : resistance(r.at("R_S")),
        inductance(r.at("L_S")),
        constant(r.at("K_m")),
        inertia(r.at("J")),
        friction(r.at("f")),
        coulomb(std::max(0.0, r.at("f_c"))),
        pole_pairs(e.pole_pairs),
        three_phase(e.three_phase) {}
  double fastest_rate(double speed) const noexcept {
    return resistance / inductance + pole_pairs * std::abs(speed) +
           constant / std::sqrt(inductance * inertia);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    const std::complex<double> u = two_phase_of(in.u, three_phase) * std::polar(1.0, -in.electrical_rad);
    const double omega_e = pole_pairs * x[2];
    return {(u.real() - resistance * x[0]) / inductance + omega_e * x[1],
            (u.imag() - resistance * x[1] - constant * x[2]) / inductance - omega_e * x[0],
            (constant * x[1] - friction * x[2] - friction_torque(x)) / inertia};
  }
  /// A shaft that comes to rest within a step stays there if friction can hold it.
  void settle(State& x, const State& before) const noexcept {
    if (x[2] * before[2] < 0.0 && std::abs(constant * x[1]) <= coulomb) x[2] = 0.0;
  }
  std::array<double, 3> currents(const State& x, const MotorInput& in) const noexcept {
    return phases_of(std::complex<double>(x[0], x[1]) * std::polar(1.0, in.electrical_rad), three_phase);
  }
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput& in) const noexcept {
    const std::complex<double> dq = two_phase_of(i, three_phase) * std::polar(1.0, -in.electrical_rad);
    return {dq.real(), dq.imag(), speed};
  }

 private:
  double friction_torque(const State& x) const noexcept {
    if (x[2] != 0.0) return std::copysign(coulomb, x[2]);
    return std::clamp(constant * x[1], -coulomb, coulomb);
  }
};

/// (L+M) i_k' = u_k - u_mean - R i_k + tau_p w (e_k - e_mean),   J w' = -tau_p sum e_k i_k - f w, with e at
/// the measured angle. Source: Chiasson 2005, chapter 10; tag BL-01.
struct BldcModel {
  using State = std::array<double, 4>;  // i_a, i_b, i_c, w
  static constexpr std::size_t kSpeed = 3;
  double resistance, inductance, constant, inertia, friction;

  explicit BldcModel(const Result& r)
      : resistance(r.at("R_S")),
        inductance(r.at("L+M")),
        constant(r.at("tau_p")),
        inertia(r.at("J")),
        friction(r.at("f")) {}
  double fastest_rate(double) const noexcept {
    return resistance / inductance + 2.0 * constant / std::sqrt(inductance * inertia);
  }
  State slope(const State& x, const MotorInput& in) const noexcept {
    constexpr double kThird = 2.0943951023931953;
    std::array<double, 3> e{};
    for (std::size_t k = 0; k < 3; ++k)
      e[k] = back_emf_shape(in.electrical_rad - static_cast<double>(k) * kThird);
    const double e_mean = (e[0] + e[1] + e[2]) / 3.0;
    const double u_mean = (in.u[0] + in.u[1] + in.u[2]) / 3.0;
    State dx{};
    double torque = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      dx[k] = (in.u[k] - u_mean - resistance * x[k] + constant * x[3] * (e[k] - e_mean)) / inductance;
      torque -= constant * e[k] * x[k];
    }
    dx[3] = (torque - friction * x[3]) / inertia;
    return dx;
  }
  void settle(State&, const State&) const noexcept {}
  std::array<double, 3> currents(const State& x, const MotorInput&) const noexcept {
    return {x[0], x[1], x[2]};
  }
  State state_of(const std::array<double, 3>& i, double speed, const MotorInput&) const noexcept {
    return {i[0], i[1], i[2], speed};
  }
};

}  // namespace drivebench::identification
