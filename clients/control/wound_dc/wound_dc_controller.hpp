#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_estimator.hpp"
#include "clients/control/gains/loop_gains.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/math/pole_placement.hpp"
#include "clients/models/wound_dc_machine.hpp"

namespace drivebench::control {

/// The common parameters of the controllers of a DC machine with a wound field. They control its speed.
struct WoundDcAxisParameters {
  WoundDcModel machine;
  double sample_rate_hz;
  double voltage_limit_v;        ///< of the armature or of the only pair of terminals
  double current_limit_a;        ///< of the armature; the references of a move stay within it
  double field_voltage_limit_v;  ///< of a field supply of its own; else 0
  double least_flux_wb;          ///< divisions by the flux take at least this
  ShaftEstimatorParameters shaft;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }

  static constexpr std::tuple kGains{
      gains_in("machine.", &WoundDcAxisParameters::machine),
      gain("sample_rate_hz", &WoundDcAxisParameters::sample_rate_hz, GainRule::kPositive),
      gain("voltage_limit_v", &WoundDcAxisParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &WoundDcAxisParameters::current_limit_a, GainRule::kPositive),
      gain("field_voltage_limit_v", &WoundDcAxisParameters::field_voltage_limit_v, GainRule::kNotNegative),
      gain("least_flux_wb", &WoundDcAxisParameters::least_flux_wb, GainRule::kPositive),
      gains_in("", &WoundDcAxisParameters::shaft, ShaftEstimatorParameters::kWithoutTachometer)};
};

/// range_problems() of P, those of its estimator, and the loop's.
template <class P, std::size_t N>
std::vector<std::string> wound_dc_problems(const P& p, const Polynomial<N>& loop, const char* unstable) {
  std::vector<std::string> found = range_problems(p);
  if (!found.empty()) return found;
  found = p.axis.shaft.problems(p.axis.machine.friction_rate_per_s(), p.axis.period_s());
  if (!is_hurwitz(loop)) found.emplace_back(unstable);
  return found;
}

/// The state of the machine in a controller at a sample.
struct WoundDcState {
  double speed_rad_s;
  double load_rad_s2;  ///< load over inertia, if the estimator has it
  double armature_a;
  double field_a;
  double flux_wb;
  /// (K_m·λ_f·i − f·ω)/J: what the shaft does without a load.
  double motor_rad_s2;
};

/// Speed control of a DC machine with a wound field: the law gives the voltages.
class WoundDcController : public Controller {
 protected:
  /// The connection of field and armature, and with it the current that the terminals carry.
  enum class FieldConnection {
    kSeparate,  ///< the armature's
    kSeries,    ///< that of armature and field, of the armature with R_p
    kShunt,     ///< that of armature and field together
  };
  WoundDcController(const WoundDcAxisParameters& axis, FieldConnection field_connection) noexcept;

  /// The voltages for this sample, before any limit.
  virtual Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept = 0;
  /// Before anything else: a law with a speed of its own looks at current and voltage of the terminals.
  virtual ShaftEstimate seen_from_terminals(double armature_a, const ShaftEstimate& shaft,
                                            std::int64_t periods) noexcept;
  /// The integrals go on by one period, unless they drive a voltage further beyond its limit; `excess_v` is
  /// what was wanted beyond.
  virtual void integrate(const Setpoint& excess_v) noexcept = 0;

  double clamped_armature_v(double wanted_v) const noexcept;
  double clamped_field_v(double wanted_v) const noexcept;
  /// ∫ + T·error, unless the error drives the voltage further beyond its limit.
  double integrated(double integral, double error, double excess_v) const noexcept {
    return error * excess_v > 0.0 ? integral : integral + axis_.period_s() * error;
  }
  const WoundDcModel& machine() const noexcept { return axis_.machine; }
  /// The flux for a division.
  double divisor_wb(double flux_wb) const noexcept;
  /// Of the last sample, behind the limits.
  const Setpoint& last() const noexcept { return last_; }

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept final;

  WoundDcAxisParameters axis_;
  FieldConnection field_connection_;
  ShaftEstimator shaft_;
  Setpoint last_;
};

}  // namespace drivebench::control
