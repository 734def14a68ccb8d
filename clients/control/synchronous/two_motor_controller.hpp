#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/loop_gains.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/servo_loop.hpp"
#include "clients/models/pm_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// The second rotor falls back behind the first while the first turns from one angle on.
struct FallBack {
  double distance_rad;
  double from_rad;
  double over_rad;

  static constexpr std::tuple kGains{gain("distance_rad", &FallBack::distance_rad),
                                     gain("from_rad", &FallBack::from_rad, GainRule::kNotNegative),
                                     gain("over_rad", &FallBack::over_rad, GainRule::kPositive)};

  /// The reference of the second rotor: its angle is a function of that of the first.
  Reference behind(const Reference& first) const noexcept;
};

struct TwoMotorParameters {
  PmMachineModel first;
  PmMachineModel second;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;
  double current_limit_a;  ///< of the wanted i_q of each motor
  ServoGains position;
  SpeedObserverGains speed_observer;
  double current_v_per_a;   ///< of the error of i_q
  double near_determinant;  ///< damping begins below, and the integrators stop
  double damping;
  double rest_s;  ///< zero voltage before the first reference, in which the rotors come to rest
  FallBack fall_back;

  static constexpr std::tuple kGains{
      gains_in("machine.", &TwoMotorParameters::first),
      gains_in("second_machine.", &TwoMotorParameters::second),
      gain("sample_rate_hz", &TwoMotorParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &TwoMotorParameters::counts_per_revolution, GainRule::kPositive),
      gain("voltage_limit_v", &TwoMotorParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &TwoMotorParameters::current_limit_a, GainRule::kPositive),
      gains_in("position.", &TwoMotorParameters::position),
      gains_in("speed_observer.", &TwoMotorParameters::speed_observer),
      gain("current_v_per_a", &TwoMotorParameters::current_v_per_a, GainRule::kNotNegative),
      gain("near_determinant", &TwoMotorParameters::near_determinant, GainRule::kPositive),
      gain("damping", &TwoMotorParameters::damping, GainRule::kPositive),
      gain("rest_s", &TwoMotorParameters::rest_s, GainRule::kPause),
      gains_in("fall_back.", &TwoMotorParameters::fall_back)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// The voltages u_a, u_b with these components across the q axes of two rotors at electrical angles θ_1, θ_2:
///   v_q1 = −u_a·sin θ_1 + u_b·cos θ_1
///   v_q2 = −u_a·sin θ_2 + u_b·cos θ_2
/// The determinant is sin(θ_2 − θ_1); at 0 no u_a, u_b have two different components. `damping` δ gives the
/// nearest ones, u = A'·(A·A' + δ²·I)⁻¹·v, which are the exact ones at 0. Source: the book, problem 9.9
/// (ST-05).
TwoPhase voltages_across(const std::array<double, 2>& angles_rad, const std::array<double, 2>& v_q_v,
                         double damping) noexcept;

/// Positions of two PM motors in parallel on one amplifier: both have its voltages, and each gets the one
/// across its q axis. The d currents follow as they must; they give no torque, but heat. Each motor:
///   v_q = R·i_ref + (K_m + n_p·L·i_d)·ω + k·(i_ref − i_q),   K_m·i_ref = J·α + f·ω_ref
/// with α of the ServoLoop. The magnets lie along phase a at count 0. Source: the book, problem 9.9 (ST-05).
class TwoMotorController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit TwoMotorController(const TwoMotorParameters& p) noexcept;

 private:
  struct Motor {
    PmMachineModel machine;
    ShaftSensing shaft;
    ServoLoop servo;
    double start_rad = 0.0;  ///< where it rests before the first reference
    double electrical_rad = 0.0;
    double error_rad = 0.0;
    double last_i_q_a = 0.0;

    void measure(std::int64_t count, std::int64_t periods) noexcept;
    double turned_rad() const noexcept { return shaft.angle_rad() - start_rad; }
  };

  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  double wanted_v(Motor& motor, const Reference& r, TwoPhase current_a) const noexcept;
  Motor motor_of(const PmMachineModel& machine) const noexcept;

  TwoMotorParameters p_;
  Motor first_;
  Motor second_;
  std::int64_t rest_samples_;
};

}  // namespace drivebench::control
