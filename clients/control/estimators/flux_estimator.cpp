#include "clients/control/estimators/flux_estimator.hpp"

#include <string_view>

#include "plant/math/length.hpp"
#include "plant/math/trig.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

InductionMotorModel motor_of(const InductionMachineModel& machine,
                             const FluxEstimatorParameters& p) noexcept {
  return {.machine = machine,
          .stator_resistance_ohm = p.stator_resistance_ohm,
          .stator_inductance_h = p.stator_inductance_h};
}

bool uses_the_voltage(FluxSource source) noexcept {
  return source == FluxSource::kVergheseSanders || source == FluxSource::kMartinRouchon;
}

/// A flux as magnitude and angle.
struct Polar {
  double magnitude_wb;
  double angle_rad;
};
Polar polar(TwoPhase flux_wb) noexcept {
  return {.magnitude_wb = length(flux_wb.a, flux_wb.b), .angle_rad = arctangent2(flux_wb.b, flux_wb.a)};
}

Polar seen(const PolarFluxObserver& observer, TwoPhase, double) noexcept {
  return {.magnitude_wb = observer.magnitude_wb(), .angle_rad = observer.angle_rad()};
}
Polar seen(const StationaryFluxObserver& observer, TwoPhase, double) noexcept {
  return polar(observer.flux_wb());
}
Polar seen(const VergheseSandersObserver& observer, TwoPhase current_a, double) noexcept {
  return polar(observer.flux_wb(current_a));
}
Polar seen(const MartinRouchonObserver& observer, TwoPhase current_a, double) noexcept {
  return polar(observer.flux_wb(current_a));
}
Polar seen(const RotorFrameObserver& observer, TwoPhase, double shaft_angle_rad) noexcept {
  return polar(observer.flux_wb(shaft_angle_rad));
}

using Held = FluxEstimator::Held;

void carry(PolarFluxObserver& observer, const Held& held, TwoPhase) noexcept {
  observer.step(held.current_a, held.speed_rad_s);
}
void carry(StationaryFluxObserver& observer, const Held& held, TwoPhase current_a) noexcept {
  observer.step(current_a, held.speed_rad_s);
}
void carry(VergheseSandersObserver& observer, const Held& held, TwoPhase current_a) noexcept {
  observer.step(current_a, held.voltage_v, held.speed_rad_s);
}
void carry(MartinRouchonObserver& observer, const Held& held, TwoPhase current_a) noexcept {
  observer.step(current_a, held.voltage_v, held.speed_rad_s);
}
void carry(RotorFrameObserver& observer, const Held& held, TwoPhase current_a) noexcept {
  observer.step(current_a, held.shaft_angle_rad);
}

}  // namespace

std::vector<std::string> FluxEstimatorParameters::problems(const std::string& prefix,
                                                           const InductionMachineModel& machine,
                                                           double period_s) const {
  std::vector<std::string> found;
  const auto expect = [&](bool holds, std::string_view rule) {
    if (!holds) found.push_back(prefix + std::string(rule));
  };
  if (uses_the_voltage(source)) {
    expect(stator_resistance_ohm > 0.0,
           "stator_resistance_ohm must be positive for an observer that uses the voltage");
    expect(stator_inductance_h >
               machine.mutual_inductance_h * machine.mutual_inductance_h / machine.rotor_inductance_h,
           "stator_inductance_h must be above M*M/L_R of the machine: its leakage is positive");
  }
  if (source == FluxSource::kVergheseSanders) {
    expect(correction * machine.mutual_inductance_h < machine.rotor_inductance_h,
           "correction must be below L_R/M of the machine: from there on the error of the flux grows");
  }
  if (source == FluxSource::kMartinRouchon) {
    expect(first_rate_per_h > 0.0 && second_rate_per_h > 0.0 && first_rate_per_h != second_rate_per_h,
           "first_rate_per_h and second_rate_per_h must be positive and differ");
  }
  if (source == FluxSource::kRotorFrame) {
    expect(load_pole_per_s > 0.0 && load_pole_per_s * period_s < 2.0,
           "load_pole_per_s must be positive and below twice the sample rate");
  }
  return found;
}

FluxEstimator::Observer FluxEstimator::observer_of(const InductionMachineModel& machine,
                                                   const FluxEstimatorParameters& p,
                                                   double period_s) noexcept {
  const TwoPhase start_wb = {.a = p.start_wb, .b = 0.0};
  constexpr TwoPhase kNoCurrent = {.a = 0.0, .b = 0.0};
  const auto copy = [&](FluxStep how) {
    StationaryFluxObserver observer(machine, period_s, how);
    observer.start_at(start_wb);
    return observer;
  };
  switch (p.source) {
    case FluxSource::kEulerCopy:
      return copy(FluxStep::kEuler);
    case FluxSource::kExactCopy:
      return copy(FluxStep::kExact);
    case FluxSource::kVergheseSanders: {
      VergheseSandersObserver observer(motor_of(machine, p), p.correction, period_s);
      observer.start_at(start_wb, kNoCurrent);
      return observer;
    }
    case FluxSource::kMartinRouchon: {
      const InductionMotorModel motor = motor_of(machine, p);
      MartinRouchonObserver observer(motor, p.first_rate_per_h, p.second_rate_per_h, period_s);
      observer.start_at({.a = motor.stator_share() * p.start_wb, .b = 0.0}, kNoCurrent);
      return observer;
    }
    case FluxSource::kRotorFrame: {
      const double pole = p.load_pole_per_s;
      RotorFrameObserver observer(
          machine, LoadObserverGains::placed(pole, pole, pole, machine.friction_rate_per_s()), period_s);
      observer.start_at(start_wb);
      return observer;
    }
    case FluxSource::kPolar:
      break;
  }
  PolarFluxObserver observer(machine, period_s);
  if (p.start_wb > 0.0) observer.start_at(p.start_wb);
  return observer;
}

FluxEstimator::FluxEstimator(const InductionMachineModel& machine, const FluxEstimatorParameters& p,
                             double period_s) noexcept
    : observer_(observer_of(machine, p, period_s)), period_s_(period_s) {
  sample({.a = 0.0, .b = 0.0}, 0.0);
}

std::optional<FluxEstimator::Motion> FluxEstimator::motion() const noexcept {
  const auto* observer = std::get_if<RotorFrameObserver>(&observer_);
  if (observer == nullptr) return std::nullopt;
  return Motion{.speed_rad_s = observer->speed_rad_s(), .load_nm = observer->load_nm()};
}

void FluxEstimator::step(const Held& held) noexcept {
  TwoPhase current_a{.a = 0.0, .b = 0.0};
  if (!std::holds_alternative<PolarFluxObserver>(observer_))  // which takes it along the flux
    current_a = to_ab(held.current_a, cos_sin_unbounded(angle_rad_));
  std::visit([&](auto& observer) { carry(observer, held, current_a); }, observer_);
  sample(current_a, held.shaft_angle_rad + period_s_ * held.speed_rad_s);
}

void FluxEstimator::sample(TwoPhase current_a, double shaft_angle_rad) noexcept {
  const Polar flux =
      std::visit([&](const auto& observer) { return seen(observer, current_a, shaft_angle_rad); }, observer_);
  magnitude_wb_ = flux.magnitude_wb;
  angle_rad_ = flux.angle_rad;
}

}  // namespace drivebench::control
