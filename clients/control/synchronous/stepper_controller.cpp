#include "clients/control/synchronous/stepper_controller.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

constexpr double kQuarterTurn_rad = 0.5 * std::numbers::pi;

}  // namespace

double StepperParameters::step_rad() const noexcept {
  const double in_a_full_step = mode == StepMode::kFull ? 1.0 : mode == StepMode::kHalf ? 2.0 : microsteps;
  return kQuarterTurn_rad / (pole_pairs * in_a_full_step);
}

TwoPhase step_pattern(StepMode mode, double microsteps, double electrical_rad) noexcept {
  if (mode == StepMode::kMicro) {
    const double step_rad = kQuarterTurn_rad / microsteps;
    const double angle_rad = step_rad * std::round(electrical_rad / step_rad);
    const CosSin at = cos_sin_unbounded(angle_rad);
    return {.a = at.cos, .b = at.sin};
  }
  constexpr std::array<TwoPhase, 8> kHalfSteps{
      {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
  const int stride = mode == StepMode::kFull ? 2 : 1;
  const double nearest = std::round(electrical_rad / (0.5 * kQuarterTurn_rad * stride)) * stride;
  return kHalfSteps[static_cast<std::size_t>(nearest - 8.0 * std::floor(nearest / 8.0))];
}

StepperController::StepperController(const StepperParameters& p) noexcept
    : Controller(p.drive, {"step_angle_rad"}),
      p_(p),
      difference_(p.counts_per_revolution, 1.0 / p.sample_rate_hz) {}

Setpoint StepperController::step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  const double rad_per_count = 2.0 * std::numbers::pi / p_.counts_per_revolution;
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
    const double disc_rad =
        rad_per_count * std::fmod(static_cast<double>(m.encoder_count), p_.counts_per_revolution);
    start_electrical_rad_ = kQuarterTurn_rad * std::round(p_.pole_pairs * disc_rad / kQuarterTurn_rad);
  }
  const double angle_rad = rad_per_count * static_cast<double>(m.encoder_count - start_count_);
  const double speed_rad_s = difference_.step(m.encoder_count, periods);
  const TwoPhase on =
      step_pattern(p_.mode, p_.microsteps, start_electrical_rad_ + p_.pole_pairs * r.angle_rad);
  tell({.angle_rad = angle_rad, .speed_rad_s = speed_rad_s, .saturated = false},
       {p_.step_rad() * std::round(r.angle_rad / p_.step_rad())});
  return {.a = p_.amplitude * on.a, .b = p_.amplitude * on.b};
}

std::vector<std::string> StepperParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (found.empty() && microsteps != std::floor(microsteps))
    found.emplace_back("microsteps must be a whole number");
  return found;
}

}  // namespace drivebench::control
