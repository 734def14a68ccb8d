#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/dc/dc_controller.hpp"
#include "clients/control/estimators/shaft_estimator.hpp"
#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/models/wound_dc_model.hpp"

namespace drivebench::control {

/// What all controllers of a DC machine with a wound field have. They control its speed.
struct WoundDcAxisParameters {
  WoundDcModel machine;
  double sample_rate_hz;
  double voltage_limit_v;        ///< of the armature or of the only pair of terminals
  double current_limit_a;        ///< what the references of a move may ask of the armature
  double field_voltage_limit_v;  ///< of a field supply of its own; else 0
  double least_flux_wb;          ///< divisions by the flux take at least this
  ShaftEstimatorParameters shaft;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// The gain rows of member `axis` of P.
template <class P>
inline constexpr auto kWoundDcAxisRows = std::to_array<GainRow<P>>({
    {"machine.armature_resistance_ohm",
     [](P& p) -> double& { return p.axis.machine.armature_resistance_ohm; }, GainRule::kPositive},
    {"machine.armature_inductance_h", [](P& p) -> double& { return p.axis.machine.armature_inductance_h; },
     GainRule::kPositive},
    {"machine.motor_constant", [](P& p) -> double& { return p.axis.machine.motor_constant; },
     GainRule::kPositive},
    {"machine.field_resistance_ohm", [](P& p) -> double& { return p.axis.machine.field_resistance_ohm; },
     GainRule::kPositive},
    {"machine.field_flux_scale", [](P& p) -> double& { return p.axis.machine.field_flux_scale; },
     GainRule::kPositive},
    {"machine.field_shunt_resistance_ohm",
     [](P& p) -> double& { return p.axis.machine.field_shunt_resistance_ohm; }, GainRule::kNotNegative},
    {"machine.inertia_kgm2", [](P& p) -> double& { return p.axis.machine.inertia_kgm2; },
     GainRule::kPositive},
    {"machine.friction_nms", [](P& p) -> double& { return p.axis.machine.friction_nms; },
     GainRule::kNotNegative},
    {"sample_rate_hz", [](P& p) -> double& { return p.axis.sample_rate_hz; }, GainRule::kPositive},
    {"voltage_limit_v", [](P& p) -> double& { return p.axis.voltage_limit_v; }, GainRule::kPositive},
    {"current_limit_a", [](P& p) -> double& { return p.axis.current_limit_a; }, GainRule::kPositive},
    {"field_voltage_limit_v", [](P& p) -> double& { return p.axis.field_voltage_limit_v; },
     GainRule::kNotNegative},
    {"least_flux_wb", [](P& p) -> double& { return p.axis.least_flux_wb; }, GainRule::kPositive},
    {"counts_per_revolution", [](P& p) -> double& { return p.axis.shaft.counts_per_revolution; },
     GainRule::kPositive},
    {"observer.angle_per_s", [](P& p) -> double& { return p.axis.shaft.observer.angle_per_s; }},
    {"observer.speed_per_s2", [](P& p) -> double& { return p.axis.shaft.observer.speed_per_s2; }},
    {"observer.load_per_s3", [](P& p) -> double& { return p.axis.shaft.observer.load_per_s3; }},
});

/// range_problems() of P, those of its estimator, and the loop's.
template <class P, std::size_t N>
std::vector<std::string> wound_dc_problems(const P& p, const Polynomial<N>& loop, const char* unstable) {
  std::vector<std::string> found = range_problems(p);
  if (!found.empty()) return found;
  found = p.axis.shaft.problems(p.axis.machine.friction_rate_per_s(), p.axis.period_s());
  if (!is_hurwitz(loop)) found.emplace_back(unstable);
  return found;
}

/// The machine as a controller sees it at a sample.
struct WoundDcState {
  double speed_rad_s;
  double load_rad_s2;  ///< load over inertia, if the estimator knows it
  double armature_a;
  double field_a;
  double flux_wb;
  /// (K_m·λ_f·i − f·ω)/J: what the shaft does without a load.
  double motor_rad_s2;
};

/// Speed control of a DC machine with a wound field: what is left to the law are the voltages.
class WoundDcController : public Controller {
 public:
  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods) noexcept final;
  Quantity quantity() const noexcept final { return Quantity::kVoltage; }
  double angle_rad() const noexcept final { return shaft_.now().angle_rad; }
  double speed_rad_s() const noexcept final { return speed_rad_s_; }
  bool saturated() const noexcept final { return saturated_; }
  std::span<const std::string_view> telemetry_names() const noexcept final;
  std::span<const double> telemetry() const noexcept final { return telemetry_; }

 protected:
  /// Whose current the terminals carry.
  enum class Terminals {
    kSeparate,  ///< the armature's
    kSeries,    ///< that of armature and field, of the armature with R_p
    kShunt,     ///< that of armature and field together
  };
  WoundDcController(const WoundDcAxisParameters& axis, Terminals terminals) noexcept;

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
  WoundDcAxisParameters axis_;
  Terminals terminals_;
  ShaftEstimator shaft_;
  Setpoint last_;
  double speed_rad_s_ = 0.0;
  bool saturated_ = false;
  std::array<double, 4> telemetry_{};
};

}  // namespace drivebench::control
