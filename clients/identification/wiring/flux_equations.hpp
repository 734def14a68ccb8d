#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// How a wiring fits the flux equations of a record.
struct FluxFit {
  double square_sum = 0.0;     ///< of what the equations leave [Wb^2]
  double share = 1.0;          ///< of that in the square sum of the voltages' integrals
  double voltage_shift = 0.0;  ///< [periods], as Processing::voltage_shift
  double shift_deviation = 0.0;
  double zero_rad = 0.0;  ///< PM, brushless: electrical angle of the magnet where the encoder says zero
  double zero_deviation = 0.0;
};

/// The voltage equations of a record, integrated over some thousand windows, so that they hold no derivative
/// and no speed. The windows differ in length: of equal ones at a constant speed, pole pairs that differ by a
/// turn per window would look alike. With U, I the integrals of voltage and current, D a difference over a
/// window, h a sum of mid-values times steps of the angle (the integral over the angle), s the voltage shift
/// and T the period:
///   DC, PM, brushless:  DU + s T Du = R DI + L Di + psi D e^(j n theta)   (DC: + K D theta)
///   a salient rotor:    + L_g D(e^(2j (n theta + zero)) conj(i)), with L_S for L
///   induction: the same for phi = U - R I - sigma L_S i + lambda_0 with (8.4)-(8.6) of the book:
///     D(U - R I - sigma L_S i) = -(1/T_R) integral phi + j n h(phi) + (1 - sigma) L_S/T_R DI
/// All of it is linear in R, L, psi, s, L_g e^(2j zero), and for an induction motor in R, sigma L_S, 1/T_R
/// and products of these, which a fit takes as independent. So a hypothesis costs one small least squares.
class FluxEquations {
 public:
  /// `whole_shift` periods are taken off the voltages' shift first.
  FluxEquations(const MeasuredData& data, const Settings& settings, int whole_shift);

  /// `turn`: pole pairs, negative if the encoder counts against the phases; for a DC motor the direction
  /// alone, whose torque constant may not be negative in it. `salient`: of a PM synchronous motor.
  FluxFit fit(int turn, bool salient = false) const;

  /// The largest step of the angle in a period, averaged over a window [rad].
  double fastest_rad() const noexcept { return fastest_rad_; }

 private:
  /// One window; complex numbers are the two-phase equivalent in the stator's frame.
  struct Window {
    std::complex<double> u_integral, i_integral, u_step, i_step, first_i, last_i;
    std::complex<double> flux_time, charge_time;  ///< integrals of U and I
    std::complex<double> over_angle_flux, over_angle_charge, over_angle_i, over_angle_u;
    double duration_s, angle_step, first_angle, last_angle;
  };

  std::size_t columns(bool salient) const noexcept;
  std::size_t harmonics() const noexcept;
  std::complex<double> put_row(const Window& w, double n, bool salient,
                               std::span<std::complex<double>> columns) const;
  std::vector<double> noise_of_columns(double n, bool salient) const;
  void add_windows(const std::vector<std::complex<double>>& u, const std::vector<std::complex<double>>& i,
                   const Series& angle, const SampleRange& range);

  MotorKind kind_;
  double period_s_;
  int whole_shift_;
  double mean_s_ = 0.0;  ///< length of a window
  double fastest_rad_ = 0.0;
  double u_noise_v_ = 0.0;  ///< rms of a phase, an upper bound
  double i_noise_a_ = 0.0;
  double angle_noise_rad_ = 0.0;
  std::vector<Window> windows_;
};

}  // namespace drivebench::identification
