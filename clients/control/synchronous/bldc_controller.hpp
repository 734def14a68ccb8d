#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/servo_loop.hpp"
#include "clients/control/synchronous/bldc_commutation.hpp"
#include "clients/models/bldc_machine.hpp"

namespace drivebench::control {

enum class CommutationBy { kEncoder, kHall };

struct BldcParameters {
  BldcMachineModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< of a terminal against the middle of the DC link
  double current_limit_a;
  ServoGains position;
  CurrentGains current;  ///< with Quantity::kVoltage
  SpeedObserverGains speed_observer;
  double angle_lead_samples =
      0.5;  ///< the sector is that of the angle so many samples on; not with Hall lines
  CommutationBy commutation = CommutationBy::kEncoder;
  Quantity drive = Quantity::kCurrent;

  static constexpr std::tuple kGains{
      gains_in("machine.", &BldcParameters::machine),
      gain("sample_rate_hz", &BldcParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &BldcParameters::counts_per_revolution, GainRule::kPositive),
      gain("voltage_limit_v", &BldcParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &BldcParameters::current_limit_a, GainRule::kPositive),
      gains_in("position.", &BldcParameters::position),
      gains_in("current.", &BldcParameters::current),
      gains_in("speed_observer.", &BldcParameters::speed_observer),
      gain("angle_lead_samples", &BldcParameters::angle_lead_samples, GainRule::kNotNegative)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// Servo control of a brushless DC machine with six-step commutation:
///   I_p = (J/(2·τ_p))·(α_ref + K0·∫e + K1·e + K2·(ω_ref − ω)),  i_k,ref = I_p·c_k(sector)
/// with c_k from (10.10), sectors from the encoder or from Hall lines. Friction is not fed forward, the
/// integral supplies it. The currents go to a current amplifier, or PI loops of the phases make voltages:
///   u_k = K_P·(i_k,ref − i_k) + K_I·∫(i_k,ref − i_k) + R_S·i_k,ref − e_p·ω·e_k
/// A current or a voltage at its limit freezes the integrals. No valid sector: no current. Source: the book,
/// (10.10), (10.13)-(10.15) (BL-03, BL-04).
class BldcController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit BldcController(const BldcParameters& p) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  std::optional<int> sector(const Measurement& m, double electrical_rad) const noexcept;
  Setpoint voltages(const Phases& wanted_a, const Phases& current_a, double electrical_rad) noexcept;

  BldcParameters p_;
  ShaftSensing shaft_;
  ServoLoop position_;
  Phases integral_v_{};
  double last_current_a_ = 0.0;
  bool saturated_ = false;
};

}  // namespace drivebench::control
