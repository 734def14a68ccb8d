#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/dc/dc_current_regulator.hpp"
#include "clients/control/estimators/shaft_estimator.hpp"
#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/models/dc_machine_model.hpp"

namespace drivebench::control {

/// How an armature gets the current that a law asks for.
enum class DcDrive {
  kCurrentAmplifier,  ///< the bench's amplifier takes it as its command
  kOwnRegulator,      ///< CUR-01 of the controller turns it into a voltage
};

/// What all controllers of a DC motor with permanent magnets have.
struct DcAxisParameters {
  DcMachineModel machine;
  double sample_rate_hz;
  double current_limit_a;
  double voltage_limit_v;
  DcDrive drive = DcDrive::kCurrentAmplifier;
  DcCurrentGains current{};  ///< of kOwnRegulator
  ShaftEstimatorParameters shaft;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
  /// The rules between numbers; those of single numbers stand in the rows.
  std::vector<std::string> problems() const;
};

template <class Row, std::size_t A, std::size_t B>
constexpr std::array<Row, A + B> joined(const std::array<Row, A>& a, const std::array<Row, B>& b) noexcept {
  std::array<Row, A + B> result{};
  for (std::size_t k = 0; k < A; ++k)
    result[k] = a[k];
  for (std::size_t k = 0; k < B; ++k)
    result[A + k] = b[k];
  return result;
}

/// The gain rows of member `axis` of P.
template <class P>
inline constexpr auto kDcAxisRows = std::to_array<GainRow<P>>({
    {"machine.resistance_ohm", [](P& p) -> double& { return p.axis.machine.resistance_ohm; },
     GainRule::kNotNegative},
    {"machine.inductance_h", [](P& p) -> double& { return p.axis.machine.inductance_h; },
     GainRule::kPositive},
    {"machine.torque_constant_nm_per_a",
     [](P& p) -> double& { return p.axis.machine.torque_constant_nm_per_a; }, GainRule::kPositive},
    {"machine.inertia_kgm2", [](P& p) -> double& { return p.axis.machine.inertia_kgm2; },
     GainRule::kPositive},
    {"machine.friction_nms", [](P& p) -> double& { return p.axis.machine.friction_nms; },
     GainRule::kNotNegative},
    {"sample_rate_hz", [](P& p) -> double& { return p.axis.sample_rate_hz; }, GainRule::kPositive},
    {"current_limit_a", [](P& p) -> double& { return p.axis.current_limit_a; }, GainRule::kPositive},
    {"voltage_limit_v", [](P& p) -> double& { return p.axis.voltage_limit_v; }, GainRule::kPositive},
    {"current.proportional_v_per_a", [](P& p) -> double& { return p.axis.current.proportional_v_per_a; },
     GainRule::kNotNegative},
    {"current.integral_v_per_as", [](P& p) -> double& { return p.axis.current.integral_v_per_as; },
     GainRule::kNotNegative},
    {"counts_per_revolution", [](P& p) -> double& { return p.axis.shaft.counts_per_revolution; },
     GainRule::kPositive},
    {"observer.angle_per_s", [](P& p) -> double& { return p.axis.shaft.observer.angle_per_s; }},
    {"observer.speed_per_s2", [](P& p) -> double& { return p.axis.shaft.observer.speed_per_s2; }},
    {"observer.load_per_s3", [](P& p) -> double& { return p.axis.shaft.observer.load_per_s3; }},
    {"tachometer.vs_per_rad", [](P& p) -> double& { return p.axis.shaft.tachometer_vs_per_rad; }},
});

/// range_problems() of P and those of its axis.
template <class P>
std::vector<std::string> dc_problems(const P& p) {
  std::vector<std::string> found = range_problems(p);
  if (!found.empty()) return found;  // the rules between numbers divide by them
  return p.axis.problems();
}

/// A controller of a DC motor with permanent magnets: what is left to the law is one number a sample. Over
/// lost samples its observers are carried on; its integrals count a gap as one period.
class DcController : public Controller {
 public:
  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods) noexcept final;
  Quantity quantity() const noexcept final { return quantity_; }
  double angle_rad() const noexcept final { return shaft_.now().angle_rad; }
  double speed_rad_s() const noexcept final { return shaft_.now().speed_rad_s; }
  bool saturated() const noexcept final { return saturated_; }
  std::span<const std::string_view> telemetry_names() const noexcept final;
  std::span<const double> telemetry() const noexcept final { return telemetry_; }

 protected:
  /// What the law commands.
  enum class Law { kCurrent, kVoltage };
  DcController(const DcAxisParameters& axis, Law law) noexcept;

  /// Amperes, or volts from a law of voltage, for this sample.
  virtual double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept = 0;
  /// The integrals of the law go on by one period. `excess` is what it wanted beyond a limit, 0 if nothing.
  virtual void integrate(double excess) noexcept = 0;

  /// integral + T·error, unless the law stands at a limit and the error drives it further out.
  double integrated(double integral, double error, double excess) const noexcept {
    return error * excess > 0.0 ? integral : integral + period_s_ * error;
  }

 private:
  double acceleration_per_a_;
  double period_s_;
  Law law_;
  DcDrive drive_;
  Quantity quantity_;
  double current_limit_a_;
  double voltage_limit_v_;
  DcCurrentRegulator regulator_;
  ShaftEstimator shaft_;
  bool saturated_ = false;
  std::array<double, 4> telemetry_{};
};

}  // namespace drivebench::control
