#include "clients/control/induction/induction_drive.hpp"

#include <algorithm>
#include <array>
#include <numbers>

#include "clients/control/gains/gain_rows.hpp"

namespace drivebench::control {
namespace {

/// A longer gap than this is 8 ms at 8 kHz, two time constants of the flux: nothing is left to carry over.
constexpr std::int64_t kLongestGap = 64;

}  // namespace

std::span<const GainRow<InductionDriveParameters>> InductionDriveParameters::gains() noexcept {
  using P = InductionDriveParameters;
  constexpr GainRule kPositive = GainRule::kPositive;
  constexpr GainRule kNotNegative = GainRule::kNotNegative;
  static constexpr auto kRows = joined(
      std::to_array<GainRow<P>>({
          {"machine.pole_pairs", [](P& p) -> double& { return p.motor.machine.pole_pairs; }, kPositive},
          {"machine.mutual_inductance_h", [](P& p) -> double& { return p.motor.machine.mutual_inductance_h; },
           kPositive},
          {"machine.rotor_resistance_ohm",
           [](P& p) -> double& { return p.motor.machine.rotor_resistance_ohm; }, kPositive},
          {"machine.rotor_inductance_h", [](P& p) -> double& { return p.motor.machine.rotor_inductance_h; },
           kPositive},
          {"machine.stator_resistance_ohm", [](P& p) -> double& { return p.motor.stator_resistance_ohm; },
           kPositive},
          {"machine.stator_inductance_h", [](P& p) -> double& { return p.motor.stator_inductance_h; },
           kPositive},
          {"machine.friction_nms", [](P& p) -> double& { return p.motor.machine.friction_nms; },
           kNotNegative},
          {"machine.inertia_kgm2", [](P& p) -> double& { return p.motor.machine.inertia_kgm2; }, kPositive},
          {"sample_rate_hz", [](P& p) -> double& { return p.sample_rate_hz; }, kPositive},
          {"counts_per_revolution", [](P& p) -> double& { return p.counts_per_revolution; }, kPositive},
          {"voltage_limit_v", [](P& p) -> double& { return p.voltage_limit_v; }, kPositive},
          {"current_limit_a", [](P& p) -> double& { return p.current_limit_a; }, kPositive},
          {"quadrature_reference_limit_a", [](P& p) -> double& { return p.quadrature_reference_limit_a; },
           kPositive},
      }),
      speed_observer_rows<P>());
  return kRows;
}

std::vector<std::string> InductionDriveParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (motor.leakage() <= 0.0) {  // a number that is none has been told already
    found.emplace_back("machine.mutual_inductance_h must be below the root of both inductances' product");
  }
  return found;
}

InductionFeedback::InductionFeedback(const InductionDriveParameters& p) noexcept
    : rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      period_s_(p.period_s()),
      observer_(p.motor.machine, p.speed_observer, p.period_s()) {}

const InductionState& InductionFeedback::sample(const Measurement& m, std::int64_t periods) noexcept {
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
  } else {
    double angle_rad = state_.angle_rad;
    for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
      observer_.step(state_.current_a, angle_rad);
      angle_rad += period_s_ * state_.speed_rad_s;
    }
  }
  state_.angle_rad = rad_per_count_ * static_cast<double>(m.encoder_count - start_count_);
  state_.speed_rad_s = observer_.speed_rad_s();
  state_.flux_wb = observer_.flux_magnitude_wb();
  state_.flux_angle_rad = observer_.flux_angle_rad();
  state_.flux = Direction::at(state_.flux_angle_rad);
  state_.current_a = state_.flux.to_dq({.a = m.i_a_a, .b = m.i_b_a});
  return state_;
}

LoadedInductionFeedback::LoadedInductionFeedback(const InductionDriveParameters& p,
                                                 double load_pole_per_s) noexcept
    : rad_per_count_(2.0 * std::numbers::pi / p.counts_per_revolution),
      period_s_(p.period_s()),
      acceleration_per_wb_a_(p.motor.machine.acceleration_per_wb_a()),
      flux_(p.motor.machine, p.period_s()),
      motion_(p.motor.machine,
              LoadObserverGains::placed(load_pole_per_s, load_pole_per_s, load_pole_per_s,
                                        p.motor.machine.friction_rate_per_s()),
              p.period_s()) {}

const InductionState& LoadedInductionFeedback::sample(const Measurement& m, std::int64_t periods) noexcept {
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
  } else {
    double angle_rad = state_.angle_rad;
    for (std::int64_t i = 0; i < std::min(periods, kLongestGap); ++i) {
      motion_.step(angle_rad, acceleration_per_wb_a_ * flux_.magnitude_wb() * state_.current_a.q);
      flux_.step(state_.current_a);
      angle_rad += period_s_ * state_.speed_rad_s;
    }
  }
  state_.angle_rad = rad_per_count_ * static_cast<double>(m.encoder_count - start_count_);
  state_.speed_rad_s = motion_.speed_rad_s();
  state_.flux_wb = flux_.magnitude_wb();
  state_.flux_angle_rad = wrapped(flux_.angle_rad(state_.angle_rad));
  state_.flux = Direction::at(state_.flux_angle_rad);
  state_.current_a = state_.flux.to_dq({.a = m.i_a_a, .b = m.i_b_a});
  return state_;
}

double clipped(double x, double limit, bool& at_limit) noexcept {
  const double y = std::clamp(x, -limit, limit);
  at_limit = at_limit || y != x;
  return y;
}

}  // namespace drivebench::control
