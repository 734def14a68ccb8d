#include "clients/control/estimators/flux_observers.hpp"

#include "plant/math/exponential.hpp"
#include "plant/math/phasor.hpp"
#include "plant/math/unbounded.hpp"

namespace drivebench::control {
namespace {

using Complex = std::complex<double>;

Complex complex_of(TwoPhase x) noexcept {
  return {x.a, x.b};
}

TwoPhase pair_of(Complex x) noexcept {
  return {x.real(), x.imag()};
}

/// η − j·n_p·ω
Complex flux_rate(const InductionMachineModel& machine, double speed_rad_s) noexcept {
  return {machine.flux_decay_per_s(), -machine.pole_pairs * speed_rad_s};
}

/// x after a time of dx/dt = −rate·x + input.
Complex relaxed(Complex x, Complex rate, Complex input, double time_s) noexcept {
  const Complex decay = phasor(-rate.imag() * time_s, exponential(-rate.real() * time_s));
  return decay * x + quotient(1.0 - decay, rate) * input;
}

}  // namespace

StationaryFluxObserver::StationaryFluxObserver(const InductionMachineModel& machine, double period_s,
                                               FluxStep kind) noexcept
    : machine_(machine), period_s_(period_s), kind_(kind) {}

void StationaryFluxObserver::step(TwoPhase current_a, double speed_rad_s) noexcept {
  const std::complex<double> rate = flux_rate(machine_, speed_rad_s);
  const std::complex<double> input =
      machine_.flux_decay_per_s() * machine_.mutual_inductance_h * complex_of(current_a);
  flux_wb_ = kind_ == FluxStep::kExact ? relaxed(flux_wb_, rate, input, period_s_)
                                       : flux_wb_ + period_s_ * (input - rate * flux_wb_);
}

double euler_error_factor(const InductionMachineModel& machine, double speed_rad_s,
                          double period_s) noexcept {
  return std::norm(1.0 - flux_rate(machine, speed_rad_s) * period_s);
}

double least_euler_rate_hz(const InductionMachineModel& machine, double speed_rad_s) noexcept {
  return std::norm(flux_rate(machine, speed_rad_s)) / (2.0 * machine.flux_decay_per_s());
}

VergheseSandersObserver::VergheseSandersObserver(const InductionMotorModel& motor, double gain,
                                                 double period_s) noexcept
    : motor_(motor), gain_(gain), share_(1.0 - gain * motor.stator_share()), period_s_(period_s) {}

double VergheseSandersObserver::error_decay_per_s() const noexcept {
  return motor_.machine.flux_decay_per_s() / share_;
}

std::complex<double> VergheseSandersObserver::flux(std::complex<double> current_a) const noexcept {
  return (z_wb_ + gain_ * motor_.leakage_inductance_h() * current_a) / share_;
}

TwoPhase VergheseSandersObserver::flux_wb(TwoPhase current_a) const noexcept {
  return pair_of(flux(complex_of(current_a)));
}

void VergheseSandersObserver::start_at(TwoPhase flux_wb, TwoPhase current_a) noexcept {
  z_wb_ = share_ * complex_of(flux_wb) - gain_ * motor_.leakage_inductance_h() * complex_of(current_a);
}

void VergheseSandersObserver::step(TwoPhase current_a, TwoPhase voltage_v, double speed_rad_s) noexcept {
  const InductionMachineModel& machine = motor_.machine;
  const std::complex<double> i = complex_of(current_a);
  const std::complex<double> rate = flux_rate(machine, speed_rad_s) / share_;
  const std::complex<double> input = machine.flux_decay_per_s() * machine.mutual_inductance_h * i -
                                     gain_ * (complex_of(voltage_v) - motor_.stator_resistance_ohm * i) -
                                     rate * gain_ * motor_.leakage_inductance_h() * i;
  z_wb_ = relaxed(z_wb_, rate, input, period_s_);
}

MartinRouchonObserver::MartinRouchonObserver(const InductionMotorModel& motor, double r1, double r2,
                                             double period_s) noexcept
    : motor_(motor),
      r1_(r1),
      r2_(r2),
      period_s_(period_s),
      stiffness_(1.0 / (motor.leakage_inductance_h() * motor.machine.rotor_inductance_h)),
      flux_gain_(r1 * r2 / stiffness_),
      current_gain_h_((r1 + r2) / stiffness_) {}

TwoPhase MartinRouchonObserver::flux_wb(TwoPhase current_a) const noexcept {
  return pair_of((stator_flux_wb_ - motor_.leakage_inductance_h() * complex_of(current_a)) /
                 motor_.stator_share());
}

void MartinRouchonObserver::start_at(TwoPhase stator_flux_wb, TwoPhase current_a) noexcept {
  stator_flux_wb_ = complex_of(stator_flux_wb);
  current_a_ = complex_of(current_a);
}

void MartinRouchonObserver::step(TwoPhase current_a, TwoPhase voltage_v, double speed_rad_s) noexcept {
  const std::complex<double> i = complex_of(current_a);
  const std::complex<double> u = complex_of(voltage_v);
  const std::complex<double> s = motor_.machine.rotor_inductance_h * flux_rate(motor_.machine, speed_rad_s);
  const std::complex<double> to_flux = u - motor_.stator_resistance_ohm * i + s * flux_gain_ * i;
  const std::complex<double> to_current =
      (s * stiffness_ * current_gain_h_ - s / motor_.machine.rotor_inductance_h -
       motor_.current_decay_per_s()) *
          i +
      u / motor_.leakage_inductance_h();

  // Along the eigenvectors of A, (c1, r1) and (c1, r2), both parts relax on their own at s·r.
  const double difference = r1_ - r2_;
  const auto first = [&](std::complex<double> flux, std::complex<double> current) {
    return (current - r2_ / flux_gain_ * flux) / difference;
  };
  const auto second = [&](std::complex<double> flux, std::complex<double> current) {
    return (r1_ / flux_gain_ * flux - current) / difference;
  };
  const std::complex<double> x1 =
      relaxed(first(stator_flux_wb_, current_a_), s * r1_, first(to_flux, to_current), period_s_);
  const std::complex<double> x2 =
      relaxed(second(stator_flux_wb_, current_a_), s * r2_, second(to_flux, to_current), period_s_);
  stator_flux_wb_ = flux_gain_ * (x1 + x2);
  current_a_ = r1_ * x1 + r2_ * x2;
}

RotorFrameObserver::RotorFrameObserver(const InductionMachineModel& machine, const LoadObserverGains& gains,
                                       double period_s) noexcept
    : machine_(machine),
      kept_(exponential(-machine.flux_decay_per_s() * period_s)),
      motion_(machine, gains, period_s) {}

TwoPhase RotorFrameObserver::flux_wb(double shaft_angle_rad) const noexcept {
  const CosSin rotor = cos_sin_unbounded(machine_.pole_pairs * shaft_angle_rad);
  return to_ab({.d = flux_wb_.a, .q = flux_wb_.b}, rotor);
}

void RotorFrameObserver::step(TwoPhase current_a, double shaft_angle_rad) noexcept {
  const Dq i = to_dq(current_a, cos_sin_unbounded(machine_.pole_pairs * shaft_angle_rad));
  motion_.step(shaft_angle_rad, machine_.acceleration_per_wb_a() * (flux_wb_.a * i.q - flux_wb_.b * i.d));
  const double gain_h = (1.0 - kept_) * machine_.mutual_inductance_h;
  flux_wb_ = {.a = kept_ * flux_wb_.a + gain_h * i.d, .b = kept_ * flux_wb_.b + gain_h * i.q};
}

}  // namespace drivebench::control
