#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/dc/dc_current_regulator.hpp"
#include "clients/control/estimators/shaft_estimator.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/models/dc_machine.hpp"

namespace drivebench::control {

/// The regulator of the armature current.
enum class DcDrive {
  kCurrentAmplifier,  ///< the amplifier of the bench, which takes the current as its command
  kOwnRegulator,      ///< CUR-01 of the controller, which turns the current into a voltage
};

/// The common parameters of the controllers of a DC motor with permanent magnets.
struct DcAxisParameters {
  DcMachineModel machine;
  double sample_rate_hz;
  double current_limit_a;
  double voltage_limit_v;
  DcDrive drive = DcDrive::kCurrentAmplifier;
  CurrentGains current{};  ///< of kOwnRegulator
  ShaftEstimatorParameters shaft;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
  /// The rules between numbers; those of single numbers stand in the rows.
  std::vector<std::string> problems() const;

  static constexpr std::tuple kGains{
      gains_in("machine.", &DcAxisParameters::machine),
      gain("sample_rate_hz", &DcAxisParameters::sample_rate_hz, GainRule::kPositive),
      gain("current_limit_a", &DcAxisParameters::current_limit_a, GainRule::kPositive),
      gain("voltage_limit_v", &DcAxisParameters::voltage_limit_v, GainRule::kPositive),
      gains_in("current.", &DcAxisParameters::current),
      gains_in("", &DcAxisParameters::shaft)};
};

/// range_problems() of P and those of its axis.
template <class P>
std::vector<std::string> dc_problems(const P& p) {
  std::vector<std::string> found = range_problems(p);
  if (!found.empty()) return found;  // the rules between numbers divide by them
  return p.axis.problems();
}

/// A controller of a DC motor with permanent magnets: the law gives one number a sample. Over
/// lost samples its observers are carried on; its integrals count a gap as one period.
class DcController : public Controller {
 protected:
  /// The quantity that the law commands.
  enum class Law { kCurrent, kVoltage };
  DcController(const DcAxisParameters& axis, Law law) noexcept;

  /// Computes the command of the law for this sample: amperes or volts.
  virtual double wanted(const Reference& r, const ShaftEstimate& shaft, double armature_a) noexcept = 0;
  /// Carries the integrals of the law on by one period. `excess` is the part of the command beyond a limit.
  virtual void integrate(double excess) noexcept = 0;

  /// integral + T·error, unless the law stands at a limit and the error drives it further out.
  double integrated(double integral, double error, double excess) const noexcept {
    return error * excess > 0.0 ? integral : integral + period_s_ * error;
  }

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept final;

  double acceleration_per_a_;
  double period_s_;
  Law law_;
  DcDrive drive_;
  double current_limit_a_;
  double voltage_limit_v_;
  DcCurrentRegulator regulator_;
  ShaftEstimator shaft_;
};

}  // namespace drivebench::control
