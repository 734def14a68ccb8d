// The observers of the induction machine beside the machine itself, on the product's benches: case 17,
// exercises 19 to 27 of chapter 8.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include "clients/control/estimators/flux_observers.hpp"
#include "clients/control/estimators/load_observers.hpp"
#include "plant/math/unbounded.hpp"
#include "tests/book/book_bench.hpp"
#include "tests/book/closed_loop.hpp"
#include "tests/clients/control/induction/servo_motor.hpp"

namespace drivebench::control_induction_observers_test {
namespace {

using control::kServoMotor;
using Complex = std::complex<double>;

constexpr double kRadPerCount = 2.0 * std::numbers::pi / 2000.0;

TwoPhase current_of(const Sample& s) {
  return {.a = s.true_i_a_a, .b = s.true_i_b_a};
}
TwoPhase voltage_of(const Sample& s) {
  return {.a = s.u_a_v, .b = s.u_b_v};
}
Complex flux_of(const Sample& s) {
  return {s.psi_a_wb, s.psi_b_wb};
}
/// Of an estimate, relative to the true flux.
double flux_error(TwoPhase estimate_wb, const Sample& s) {
  return std::abs(Complex(estimate_wb.a, estimate_wb.b) - flux_of(s)) / std::abs(flux_of(s));
}

/// A bench of configs/benches sampled at this rate.
BookBench bench_at(const std::string& name, double rate_hz) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + name + ".toml");
  config.setup.period_ns = std::llround(1e9 / rate_hz);
  config.setup.substeps = std::clamp(static_cast<int>(std::ceil(1e5 / rate_hz)), 1, 64);
  return BookBench(config);
}

/// Largest errors of the last tenth of a second of the line start, each relative to the true flux.
struct FluxErrors {
  double euler = 0.0;
  double exact = 0.0;
  double polar = 0.0;     ///< magnitude only
  double position = 0.0;  ///< magnitude and angle
};

FluxErrors flux_errors(double rate_hz) {
  const double period_s = 1.0 / rate_hz;
  control::StationaryFluxObserver euler(kServoMotor.machine, period_s, control::FluxStep::kEuler);
  control::StationaryFluxObserver exact(kServoMotor.machine, period_s, control::FluxStep::kExact);
  control::PolarFluxObserver polar(kServoMotor.machine, period_s);
  control::PositionFluxObserver position(kServoMotor.machine, period_s);
  FluxErrors worst;
  BookBench bench = bench_at("servo-line", rate_hz);
  bench.run_until(1.0, [&](const Sample& s) {
    const double position_rad = position.angle_rad(s.angle_rad);
    if (static_cast<double>(s.tick) * period_s > 0.9) {
      const double magnitude_wb = std::abs(flux_of(s));
      worst.euler = std::max(worst.euler, flux_error(euler.flux_wb(), s));
      worst.exact = std::max(worst.exact, flux_error(exact.flux_wb(), s));
      worst.polar = std::max(worst.polar, std::abs(polar.magnitude_wb() / magnitude_wb - 1.0));
      worst.position =
          std::max(worst.position,
                   std::abs(std::polar(position.magnitude_wb(), position_rad) - flux_of(s)) / magnitude_wb);
    }
    const TwoPhase i = current_of(s);
    euler.step(i, s.speed_rad_s);
    exact.step(i, s.speed_rad_s);
    polar.step(to_dq(i, cos_sin_unbounded(polar.angle_rad())), s.speed_rad_s);
    position.step(to_dq(i, cos_sin_unbounded(position_rad)));
  });
  EXPECT_NEAR(bench.sample().speed_rad_s, 125.40, 0.1) << rate_hz;
  return worst;
}

// Case 17: 5 %, and 1e-4 for those in polar form. Catches: an observer that takes the current of the wrong
// sample: the rectangular ones lag by half a period, which is all of their error.
TEST(InductionObservers, TheFluxErrorsOnTheLineAreThoseOfTheTable) {
  const FluxErrors at_10_khz = flux_errors(10e3);
  EXPECT_NEAR(at_10_khz.euler, 0.0262, 0.05 * 0.0262);
  EXPECT_NEAR(at_10_khz.exact, 0.0189, 0.05 * 0.0189);
  EXPECT_LT(at_10_khz.polar, 1e-4);
  EXPECT_LT(at_10_khz.position, 1e-4);
  const FluxErrors at_20_khz = flux_errors(20e3);
  EXPECT_NEAR(at_20_khz.euler, 0.0129, 0.05 * 0.0129);
  EXPECT_NEAR(at_20_khz.exact, 0.0095, 0.05 * 0.0095);
  const FluxErrors at_2_khz = flux_errors(2e3);
  EXPECT_NEAR(at_2_khz.euler, 0.146, 0.05 * 0.146);
  EXPECT_NEAR(at_2_khz.exact, 0.096, 0.05 * 0.096);
  EXPECT_LT(at_2_khz.polar, 1e-4);
}

// Exercise 19, negative. Catches: an Euler observer that cannot diverge: below the least rate of 125.4 rad/s,
// 392 Hz, it does, while the exponential only lags and the polar form is unaffected.
TEST(InductionObservers, EulerDivergesAt330Hertz) {
  EXPECT_NEAR(control::least_euler_rate_hz(kServoMotor.machine, 125.4), 393.3, 1.0);
  const FluxErrors at_330_hz = flux_errors(330.0);
  EXPECT_GT(at_330_hz.euler, 1e3);
  EXPECT_NEAR(at_330_hz.exact, 0.625, 0.05 * 0.625);
  EXPECT_LT(at_330_hz.polar, 1e-4);
}

/// Largest errors of the second half of the line start [rad/s].
struct SpeedErrors {
  double observer = 0.0;
  double difference = 0.0;
};

SpeedErrors speed_errors(double rate_hz) {
  const double period_s = 1.0 / rate_hz;
  control::CoupledObserver observer(kServoMotor.machine, {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5},
                                    period_s);
  control::BackwardDifference difference(2000.0, period_s);
  SpeedErrors worst;
  BookBench bench = bench_at("servo-line", rate_hz);
  bench.run_until(0.5, [&](const Sample& s) {
    const double differenced_rad_s = difference.step(s.encoder_count, 1);
    if (static_cast<double>(s.tick) * period_s > 0.25) {
      worst.observer = std::max(worst.observer, std::abs(observer.speed_rad_s() - s.speed_rad_s));
      worst.difference = std::max(worst.difference, std::abs(differenced_rad_s - s.speed_rad_s));
    }
    observer.step(current_of(s), kRadPerCount * static_cast<double>(s.encoder_count));
  });
  return worst;
}

// Exercise 24 with the observer of IMO-05, which turns its own flux: no worse than the table's 2.25, 1.12 and
// 0.81 rad/s by more than a quarter, against 31 rad/s of the difference at 10 kHz. Catches: an observer
// without its torque input.
TEST(InductionObservers, TheSpeedErrorsOnTheLineStayNearTheTable) {
  EXPECT_LT(speed_errors(1e3).observer, 2.8);
  EXPECT_LT(speed_errors(2e3).observer, 1.4);
  const SpeedErrors at_10_khz = speed_errors(10e3);
  EXPECT_LT(at_10_khz.observer, 1.0);
  EXPECT_NEAR(at_10_khz.difference, 31.15, 0.5);
}

/// Time until an observer that starts with a flux of 0.5 Wb too much is within 5 % for good [s].
template <class Observer>
double settling_s(Observer observer) {
  constexpr double kRate_hz = 20e3;
  BookBench bench = bench_at("servo-line", kRate_hz);
  bench.run_until(0.3);
  Sample before = bench.sample();
  observer.start_at(before);
  double settled_s = 0.0;
  bench.run_until(0.4, [&](const Sample& s) {
    observer.step(before, s);
    if (flux_error(observer.flux_wb(s), s) > 0.05) settled_s = bench.now_s() - 0.3;
    before = s;
  });
  return settled_s;
}

struct VergheseSanders {
  control::VergheseSandersObserver observer;

  void start_at(const Sample& s) {
    observer.start_at({.a = s.psi_a_wb + 0.5, .b = s.psi_b_wb}, current_of(s));
  }
  /// The voltage of the later sample was in force in between.
  void step(const Sample& before, const Sample& now) {
    observer.step(current_of(before), voltage_of(now), before.speed_rad_s);
  }
  TwoPhase flux_wb(const Sample& s) const { return observer.flux_wb(current_of(s)); }
};

// Case 18 on the machine: from 0.5 Wb to 5 % of 0.169 Wb takes 4.08 time constants, of 3.59 ms for the copy
// and 0.89 ms for k = 0.9; the held currents change that by a fifth. Catches: a correction of the
// wrong sign, which the difference of two observers would not show where both are wrong; k = 1.3 diverges.
TEST(InductionObservers, VergheseSandersSettlesFaster) {
  const auto settling = [](double gain) {
    return settling_s(VergheseSanders{control::VergheseSandersObserver(kServoMotor, gain, 50e-6)});
  };
  EXPECT_NEAR(settling(0.0), 4.08 * 3.59e-3, 3e-3);
  EXPECT_NEAR(settling(0.9), 4.08 * 0.89e-3, 0.75e-3);
  EXPECT_NEAR(settling(1.3), 0.1, 1e-3);
}

struct MartinRouchon {
  control::MartinRouchonObserver observer;

  void start_at(const Sample& s) {
    const Complex stator_wb = kServoMotor.stator_share() * (flux_of(s) + 0.5) +
                              kServoMotor.leakage_inductance_h() * Complex(s.true_i_a_a, s.true_i_b_a);
    observer.start_at({.a = stator_wb.real(), .b = stator_wb.imag()}, current_of(s));
  }
  void step(const Sample& before, const Sample& now) {
    observer.step(current_of(before), voltage_of(now), before.speed_rad_s);
  }
  TwoPhase flux_wb(const Sample& s) const { return observer.flux_wb(current_of(s)); }
};

// Exercise 27 on the machine. Catches: the printed signs of c1, c2 and di/dt: with rates R_R·r of 1000 and
// 1400 1/s the flux is found in a few milliseconds, twice as fast with twice the rates.
TEST(InductionObservers, MartinRouchonSettlesAtItsRates) {
  const auto settling = [](double factor) {
    return settling_s(MartinRouchon{
        control::MartinRouchonObserver(kServoMotor, factor * 1000.0 / 3.9, factor * 1400.0 / 3.9, 50e-6)});
  };
  const double slow_s = settling(0.5);
  const double fast_s = settling(1.0);
  EXPECT_GT(fast_s, 1e-3);
  EXPECT_LT(fast_s, 8e-3);
  EXPECT_NEAR(slow_s / fast_s, 2.0, 0.6);
}

// Exercises 25 and 26. Catches: a load of the wrong sign or size: 0.2 N·m from 0.25 s on, found by both
// observers from the encoder. The observer without load errs in speed by up to (l1/l2)·τ_L/J = 4.09 rad/s,
// less as it turns its flux away.
TEST(InductionObservers, BothLoadObserversFindTheLoad) {
  constexpr double kPeriod_s = 1e-4;
  InductionMachineModel machine = kServoMotor.machine;
  machine.friction_nms = 0.0;
  const auto gains = control::LoadObserverGains::placed(300.0, 300.0, 300.0, 0.0);
  control::RotorFrameObserver rotor_frame(machine, gains, kPeriod_s);
  control::LoadTorqueObserver load(machine, gains, kPeriod_s);
  control::PolarFluxObserver flux(machine, kPeriod_s);
  control::CoupledObserver coupled(machine, {.angle_per_s = 1.8e3, .speed_per_s2 = 8e5}, kPeriod_s);
  Spread rotor_frame_nm, load_nm, coupled_rad_s, rotor_frame_rad_s;
  double before_nm = 0.0;
  BookBench bench("im-a");
  bench.run_until(0.6, [&](const Sample& s) {
    if (bench.now_s() > 0.2 && bench.now_s() < 0.25)
      before_nm = std::max(before_nm, std::abs(load.load_nm()));
    if (bench.now_s() > 0.4) {
      rotor_frame_nm.add(rotor_frame.load_nm());
      load_nm.add(load.load_nm());
      coupled_rad_s.add(coupled.speed_rad_s() - s.speed_rad_s);
      rotor_frame_rad_s.add(rotor_frame.speed_rad_s() - s.speed_rad_s);
    }
    const TwoPhase i = current_of(s);
    const double angle_rad = kRadPerCount * static_cast<double>(s.encoder_count);
    const Dq along = to_dq(i, cos_sin_unbounded(flux.angle_rad()));
    rotor_frame.step(i, angle_rad);
    load.step(angle_rad, machine.acceleration_per_wb_a() * flux.magnitude_wb() * along.q);
    flux.step(along, s.speed_rad_s);
    coupled.step(i, angle_rad);
  });
  EXPECT_LT(before_nm, 0.02);
  EXPECT_NEAR(load_nm.mean(), 0.2, 0.004);
  EXPECT_NEAR(rotor_frame_nm.mean(), 0.2, 0.004);
  EXPECT_NEAR(rotor_frame_rad_s.mean(), 0.0, 0.2);
  EXPECT_GT(coupled_rad_s.mean(), 1.5);
  EXPECT_LT(coupled_rad_s.mean(), 4.09);
}

/// The flux that the controller of a run believes in, less the true one [Wb].
struct FluxEstimates {
  double settled_s = 0.0;  ///< from the first sample until within 1 mWb for good, before the move
  double moving_wb = 0.0;  ///< largest during the move
};

FluxEstimates flux_estimates(const Outcome& seen) {
  const std::size_t magnitude = seen.column("flux_wb");
  const std::size_t angle = seen.column("flux_angle_rad");
  FluxEstimates found;
  for (const ClosedLoopRow& row : seen.rows) {
    const double error_wb =
        std::abs(std::polar(row.telemetry[magnitude], row.telemetry[angle]) - flux_of(row.sample));
    if (row.phase == control::RunPhase::kMoving) found.moving_wb = std::max(found.moving_wb, error_wb);
    if (row.phase == control::RunPhase::kPreparing && error_wb > 1e-3)
      found.settled_s = row.time_s - seen.rows.front().time_s;
  }
  return found;
}

// IMO-01, 06, 07, 10, 11 as choices of the field-oriented servo. Catches: an observer that is not closed over
// the wire's samples, gets the voltage of the wrong sample, or does not forget a wrong start of 20 mWb at its
// rate: ln 20 time constants to 1 mWb.
TEST(InductionObservers, TheServoMovesOnEachOfThem) {
  const auto made = [](const char* preset) {
    const Outcome seen = closed_loop(preset);
    EXPECT_LE(seen.peak_error_while_moving_counts, 2.0) << preset;
    EXPECT_LE(seen.final_encoder_error_counts, 1.0 + 1e-9) << preset;
    return flux_estimates(seen);
  };
  const double copy_s = std::log(20.0) / kServoMotor.machine.flux_decay_per_s();
  const FluxEstimates copy = made("book/8.2.2-flux-copy");
  const FluxEstimates euler = made("book/8.2.2-flux-copy-euler");
  const FluxEstimates rotor = made("exercise/8.26");
  const FluxEstimates corrected = made("book/8.2.2-verghese-sanders");
  const FluxEstimates martin_rouchon = made("exercise/8.27");
  for (const FluxEstimates& each : {copy, euler, rotor})
    EXPECT_NEAR(each.settled_s, copy_s, 0.1 * copy_s);
  EXPECT_NEAR(corrected.settled_s, copy_s * (1.0 - 0.9 * kServoMotor.stator_share()), 0.5e-3);
  EXPECT_LT(martin_rouchon.settled_s, 0.9 * copy_s);
  // A current that is held over a period is half a period old: n_p·ω·T/2 of 45.5 mWb is 0.62 mWb at 73 rad/s,
  // and i_q changes besides; found are 1.0 to 1.4 mWb, and 2.4 where the current itself is observed.
  for (const FluxEstimates& each : {copy, euler, rotor, corrected})
    EXPECT_LT(each.moving_wb, 2.0e-3);
  EXPECT_LT(martin_rouchon.moving_wb, 4.0e-3);
}

// IMO-10. Catches: a load of the wrong sign or without the inertia, and a speed that is still the other
// observer's: 0.1 N·m from the start of the move on.
TEST(InductionObservers, TheRotorFrameObserverTellsTheServoItsLoad) {
  const Outcome seen = closed_loop("exercise/8.26", {}, {}, {{.load_nm = 0.1, .after_s = 0.0}});
  const std::size_t load = seen.column("load_nm");
  double before_nm = 0.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.phase == control::RunPhase::kPreparing)
      before_nm = std::max(before_nm, std::abs(row.telemetry[load]));
  }
  EXPECT_LT(before_nm, 0.02);
  EXPECT_NEAR(seen.rows.back().telemetry[load], 0.1, 0.005);
  EXPECT_LE(seen.peak_error_counts, 4.0);
}

}  // namespace
}  // namespace drivebench::control_induction_observers_test
