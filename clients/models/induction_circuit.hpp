#pragma once

#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "clients/models/induction_machine.hpp"
#include "plant/math/length.hpp"
#include "plant/math/phasor.hpp"

namespace drivebench {

/// An induction machine on a symmetric line of fixed frequency at a constant speed: phasors of one phase,
/// rms, motor convention, the phase voltage real:
///   U = (R_line + jω·L_line)·I_S + (R_S + jω·L_S)·I_S + jω·M·I_R
///   0 = (R_R/S + jω·L_R)·I_R + jω·M·I_S        with S = 1 − n_p·ω_shaft/ω
///   τ = m·n_p·M·Im{I_S·I_R*}                   with m phases
/// L_S, L_R and M are those of the two-phase equivalent; R_line and L_line stand between the line and the
/// terminals of each phase. No saturation, no iron loss.
/// Source: the book, section 7.3 (P3-04 to P3-07, P3-14).
struct InductionCircuit {
  using Complex = std::complex<double>;

  /// The machine at one slip, all phases together where it is a power.
  struct Point {
    double slip;
    double speed_rad_s;  ///< of the shaft
    Complex stator_a;
    Complex rotor_a;
    Complex terminal_v;  ///< behind R_line and L_line
    double torque_nm;    ///< of the field on the rotor
    double active_w;     ///< from the line
    double reactive_var;
    double line_loss_w;  ///< in R_line
    double stator_loss_w;
    double rotor_loss_w;
    double mechanical_w;  ///< torque times speed, friction of the shaft included

    double power_factor() const noexcept { return active_w / length(active_w, reactive_var); }
    /// Power out over power in, of a motor or of a generator; 0 where neither delivers.
    double efficiency() const noexcept {
      if (active_w > 0.0 && mechanical_w > 0.0) return mechanical_w / active_w;
      return active_w < 0.0 && mechanical_w < 0.0 ? active_w / mechanical_w : 0.0;
    }
  };
  /// The circle on which the stator current lies for every slip.
  struct Circle {
    Complex centre_a;
    double radius_a;
  };
  enum class Mode { kMotor, kGenerator };

  InductionMotorModel motor;
  bool star;         ///< three phases; else two
  double voltage_v;  ///< rms, of a phase
  double frequency_hz;
  double line_resistance_ohm = 0.0;
  double line_inductance_h = 0.0;

  double phases() const noexcept { return star ? 3.0 : 2.0; }
  double pulsation_rad_s() const noexcept { return 2.0 * std::numbers::pi * frequency_hz; }
  double synchronous_rad_s() const noexcept { return pulsation_rad_s() / motor.machine.pole_pairs; }

  Point at(double slip) const noexcept {
    const Complex i_s = stator_current_a(slip);
    const Complex i_r = -mutual_ohm() * slip * i_s / (rotor_ohm() + slip * rotor_reactance_ohm());
    const Complex power = phases() * voltage_v * std::conj(i_s);
    const double speed_rad_s = (1.0 - slip) * synchronous_rad_s();
    const double torque_nm = phases() * motor.machine.pole_pairs * motor.machine.mutual_inductance_h *
                                 std::imag(i_s * std::conj(i_r)) +
                             0.0;  // not -0 at S = 0
    return {.slip = slip,
            .speed_rad_s = speed_rad_s,
            .stator_a = i_s,
            .rotor_a = i_r,
            .terminal_v = voltage_v - line_ohm() * i_s,
            .torque_nm = torque_nm,
            .active_w = power.real(),
            .reactive_var = power.imag(),
            .line_loss_w = phases() * line_resistance_ohm * std::norm(i_s),
            .stator_loss_w = phases() * motor.stator_resistance_ohm * std::norm(i_s),
            .rotor_loss_w = phases() * rotor_ohm() * std::norm(i_r),
            .mechanical_w = torque_nm * speed_rad_s};
  }

  /// Of the largest torque: the rotor's R_R/S takes most from the rest of the circuit if it equals its
  /// impedance, |R_R/S| = |Z|.
  double pull_out_slip(Mode mode) const noexcept {
    const double slip = rotor_ohm() / magnitude(seen_from_rotor_ohm());
    return mode == Mode::kMotor ? slip : -slip;
  }
  /// Of the largest mechanical power, the same for R_R·(1−S)/S and the impedance R_R + Z.
  double largest_power_slip(Mode mode) const noexcept {
    const double rest_ohm = magnitude(rotor_ohm() + seen_from_rotor_ohm());
    return rotor_ohm() / (rotor_ohm() + (mode == Mode::kMotor ? rest_ohm : -rest_ohm));
  }
  /// Of the best power factor at the terminals without R_S: √σ times the pull-out slip R_R/(σ·ω·L_R), the
  /// book's rated slip.
  double rated_slip() const noexcept {
    return rotor_ohm() / (std::sqrt(motor.leakage()) * rotor_reactance_ohm().imag());
  }
  /// The stable slip at which the torque carries load and viscous friction; nothing if it is beyond a
  /// pull-out torque.
  std::optional<double> slip_under(double load_nm) const noexcept {
    const auto excess_nm = [&](double slip) {
      const Point p = at(slip);
      return p.torque_nm - motor.machine.friction_nms * p.speed_rad_s - load_nm;
    };
    double low = pull_out_slip(Mode::kGenerator);
    double high = pull_out_slip(Mode::kMotor);
    if (excess_nm(low) > 0.0 || excess_nm(high) < 0.0) return std::nullopt;
    constexpr int kHalvings = 100;  // far below the last bit of the slip
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      (excess_nm(middle) < 0.0 ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
  /// I_S is a quotient of two linear functions of S: the centre is the image of the conjugate of its pole.
  Circle circle() const noexcept {
    const Complex pole =
        -rotor_ohm() * stator_ohm() / (rotor_reactance_ohm() * stator_ohm() - mutual_ohm() * mutual_ohm());
    const Complex centre_a = stator_current_a(std::conj(pole));
    return {centre_a, magnitude(stator_current_a(0.0) - centre_a)};
  }

 private:
  double rotor_ohm() const noexcept { return motor.machine.rotor_resistance_ohm; }
  Complex rotor_reactance_ohm() const noexcept {
    return {0.0, pulsation_rad_s() * motor.machine.rotor_inductance_h};
  }
  Complex mutual_ohm() const noexcept { return {0.0, pulsation_rad_s() * motor.machine.mutual_inductance_h}; }
  Complex line_ohm() const noexcept { return {line_resistance_ohm, pulsation_rad_s() * line_inductance_h}; }
  /// Of line and stator.
  Complex stator_ohm() const noexcept {
    return line_ohm() + Complex(motor.stator_resistance_ohm, pulsation_rad_s() * motor.stator_inductance_h);
  }
  Complex stator_current_a(Complex slip) const noexcept {
    const Complex rotor = rotor_ohm() + slip * rotor_reactance_ohm();
    return voltage_v * rotor / (stator_ohm() * rotor - slip * mutual_ohm() * mutual_ohm());
  }
  /// The impedance between the terminals of R_R/S, the line shorted.
  Complex seen_from_rotor_ohm() const noexcept {
    return rotor_reactance_ohm() - mutual_ohm() * mutual_ohm() / stator_ohm();
  }
};

}  // namespace drivebench
