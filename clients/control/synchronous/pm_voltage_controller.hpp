#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/synchronous/pm_references.hpp"
#include "clients/models/pm_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// K of v = −K·e, with v in A/s: the first row has k11 alone, the second the other four.
struct PmFeedbackGains {
  double direct_per_s;          ///< k11, of i_d
  double quadrature_per_s;      ///< k22, of i_q
  double speed_a_per_rad;       ///< k23, of ω
  double angle_a_per_rad_s;     ///< k24, of θ
  double integral_a_per_rads2;  ///< k25, of ∫θ

  static constexpr std::tuple kGains{gain("direct_per_s", &PmFeedbackGains::direct_per_s),
                                     gain("quadrature_per_s", &PmFeedbackGains::quadrature_per_s),
                                     gain("speed_a_per_rad", &PmFeedbackGains::speed_a_per_rad),
                                     gain("angle_a_per_rad_s", &PmFeedbackGains::angle_a_per_rad_s),
                                     gain("integral_a_per_rads2", &PmFeedbackGains::integral_a_per_rads2)};
};

struct PmVoltageParameters {
  PmMachineModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< per phase, of the amplifier
  PmFeedbackGains feedback;
  SpeedObserverGains speed_observer;
  /// The voltages are turned ahead by the angle of so many samples; half a sample is the mean of a hold.
  double angle_lead_samples = 0.0;
  SpeedSource speed_source = SpeedSource::kObserver;

  static constexpr std::tuple kGains{
      gains_in("machine.", &PmVoltageParameters::machine),
      gain("sample_rate_hz", &PmVoltageParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &PmVoltageParameters::counts_per_revolution, GainRule::kPositive),
      gains_in("speed_observer.", &PmVoltageParameters::speed_observer),
      gain("angle_lead_samples", &PmVoltageParameters::angle_lead_samples, GainRule::kNotNegative),
      gain("voltage_limit_v", &PmVoltageParameters::voltage_limit_v, GainRule::kPositive),
      gains_in("feedback.", &PmVoltageParameters::feedback)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// Position control of a PM synchronous machine by state feedback to the voltages, around the references of
/// the trajectory at the optimal lead angle:
///   u_d = u_d,ref − n_p·L_S·(ω·i_q − ω_ref·i_q,ref) + L_S·v_d
///   u_q = u_q,ref + n_p·L_S·(ω·i_d − ω_ref·i_d,ref) + L_S·v_q
///   v_d = −k11·(i_d − i_d,ref)
///   v_q = −k22·(i_q − i_q,ref) − k23·(ω − ω_ref) − k24·(θ − θ_ref) − k25·∫(θ − θ_ref)
/// The term −K_m·ω of the machine stays in the loop as damping. In the print v has the wrong sign, and
/// matches the printed poles only with L_S taken out of the input matrix, as here. A voltage at its limit
/// freezes the integral. The magnet lies along phase a at count 0. Source: the book, (9.8), (9.9),
/// (9.16), (9.21)-(9.42) (PMC-01, PMC-02, PMC-03, PMO-01).
class PmVoltageController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit PmVoltageController(const PmVoltageParameters& p) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  Dq wanted_voltage_v(const Reference& r, const PmReferences& ref, Dq i) const noexcept;

  PmVoltageParameters p_;
  ShaftSensing shaft_;
  double angle_integral_rad_s_ = 0.0;  // of θ − θ_ref
  double last_i_q_a_ = 0.0;
};

}  // namespace drivebench::control
