#include "clients/control/synchronous/stepper_controller.hpp"

#include <cmath>
#include <numbers>

namespace drivebench::control {
namespace {

constexpr double kQuarterTurn_rad = 0.5 * std::numbers::pi;

}  // namespace

double StepperParameters::step_rad() const noexcept {
  const double in_a_full_step = mode == StepMode::kFull ? 1.0 : mode == StepMode::kHalf ? 2.0 : microsteps;
  return kQuarterTurn_rad / (pole_pairs * in_a_full_step);
}

PhasePair step_pattern(StepMode mode, double microsteps, double electrical_rad) noexcept {
  if (mode == StepMode::kMicro) {
    const double step_rad = kQuarterTurn_rad / microsteps;
    const double angle_rad = step_rad * std::round(electrical_rad / step_rad);
    return {.a = std::cos(angle_rad), .b = std::sin(angle_rad)};
  }
  constexpr std::array<PhasePair, 8> kHalfSteps{
      {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};
  const int stride = mode == StepMode::kFull ? 2 : 1;
  const double nearest = std::round(electrical_rad / (0.5 * kQuarterTurn_rad * stride)) * stride;
  return kHalfSteps[static_cast<std::size_t>(nearest - 8.0 * std::floor(nearest / 8.0))];
}

StepperController::StepperController(const StepperParameters& p) noexcept
    : p_(p), difference_(p.counts_per_revolution, 1.0 / p.sample_rate_hz) {}

std::span<const std::string_view> StepperController::telemetry_names() const noexcept {
  static constexpr auto kNames = std::to_array<std::string_view>({"step_angle_rad"});
  return kNames;
}

Setpoint StepperController::update(const Measurement& m, const Reference& r, std::int64_t periods) noexcept {
  const double rad_per_count = 2.0 * std::numbers::pi / p_.counts_per_revolution;
  if (!started_) {
    started_ = true;
    start_count_ = m.encoder_count;
    const double disc_rad =
        rad_per_count * std::fmod(static_cast<double>(m.encoder_count), p_.counts_per_revolution);
    start_electrical_rad_ = kQuarterTurn_rad * std::round(p_.pole_pairs * disc_rad / kQuarterTurn_rad);
  }
  angle_rad_ = rad_per_count * static_cast<double>(m.encoder_count - start_count_);
  speed_rad_s_ = difference_.step(m.encoder_count, periods);
  const PhasePair on =
      step_pattern(p_.mode, p_.microsteps, start_electrical_rad_ + p_.pole_pairs * r.angle_rad);
  telemetry_ = {p_.step_rad() * std::round(r.angle_rad / p_.step_rad())};
  return {.a = p_.amplitude * on.a, .b = p_.amplitude * on.b};
}

std::span<const GainRow<StepperParameters>> StepperParameters::gains() noexcept {
  using P = StepperParameters;
  constexpr GainRule kPositive = GainRule::kPositive;
  static constexpr auto kRows = std::to_array<GainRow<P>>({
      {"machine.pole_pairs", [](P& p) -> double& { return p.pole_pairs; }, kPositive},
      {"sample_rate_hz", [](P& p) -> double& { return p.sample_rate_hz; }, kPositive},
      {"counts_per_revolution", [](P& p) -> double& { return p.counts_per_revolution; }, kPositive},
      {"amplitude", [](P& p) -> double& { return p.amplitude; }, kPositive},
      {"microsteps", [](P& p) -> double& { return p.microsteps; }, kPositive},
  });
  return kRows;
}

std::vector<std::string> StepperParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (found.empty() && microsteps != std::floor(microsteps))
    found.emplace_back("microsteps must be a whole number");
  return found;
}

}  // namespace drivebench::control
