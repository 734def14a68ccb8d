// Rated conditions, torque over slip and leakage of induction machines without stator resistance.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "tests/book/book_bench.hpp"
#include "tests/book/machines/steady_induction.hpp"

namespace drivebench::induction_rated_test {
namespace {

using Complex = std::complex<double>;

constexpr double kLine_rad_s = 2.0 * std::numbers::pi * 60.0;

InductionMachineParameters motor_of(const std::string& bench) {
  const BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + bench + ".toml");
  return std::get<InductionMachineParameters>(config.setup.axes[0].parameters.machine);
}

/// A machine without stator resistance on a stiff line, by its own derivative().
class Circle {
 public:
  explicit Circle(InductionMachineParameters p) {
    p.stator_resistance_ohm = 0.0;
    c_ = constants_of(p);
    pole_pairs_ = p.pole_pairs;
  }
  SteadyInduction at(double slip) const {
    return per_volt(c_, (1.0 - slip) * kLine_rad_s / pole_pairs_, slip * kLine_rad_s);
  }
  double power_factor(double slip) const {
    const Complex i = at(slip).current_a;
    return i.real() / std::abs(i);
  }
  double torque_nm(double slip) const { return at(slip).torque_nm; }  ///< at 1 V

 private:
  InductionMachineConstants c_{};
  double pole_pairs_ = 1.0;
};

/// The slip of the largest value, by golden section: good to 1e-8, as far as a maximum can be seen.
template <class F>
double slip_of_largest(double high, F f) {
  constexpr double kGolden = 0.6180339887498949;
  double low = 0.0;
  for (int k = 0; k < 100; ++k) {
    const double left = high - kGolden * (high - low);
    const double right = low + kGolden * (high - low);
    (f(left) < f(right) ? low : high) = f(left) < f(right) ? left : right;
  }
  return 0.5 * (low + high);
}

struct Rated {
  double slip;         ///< of the largest power factor
  double pull_slip;    ///< of the largest torque
  double factor;       ///< the power factor then
  double no_load;      ///< I_S0/I_Sr
  double pull_torque;  ///< tau_p/tau_r
};

Rated rated(const Circle& machine) {
  const double pull = slip_of_largest(20.0, [&](double s) { return machine.torque_nm(s); });
  const double slip = slip_of_largest(pull, [&](double s) { return machine.power_factor(s); });
  return {.slip = slip,
          .pull_slip = pull,
          .factor = machine.power_factor(slip),
          .no_load = std::abs(machine.at(0.0).current_a) / std::abs(machine.at(slip).current_a),
          .pull_torque = machine.torque_nm(pull) / machine.torque_nm(slip)};
}

// AC-24, P3-05 and P3-06: the ratios of Figs 7.16 and 7.17 by their formulas, 1e-3; the slips of best power
// factor and of most torque are searched for, not taken from them; the motors of Leonhard measured there are
// within 15 %. Catches: a leakage factor that enters current and torque differently, a rotor resistance that
// changes more than the slips.
TEST(BookInductionRated, TheRatedRatiosFollowFromTheLeakageFactor) {
  struct Case {
    double leakage;
    int pole_pairs;
    double slip, factor, pull_torque, measured_factor, measured_torque;
  };
  for (const Case& c :
       {Case{0.05, 1, 0.2236, 0.9048, 2.348, 0.90, 2.30}, Case{0.10, 4, 0.3162, 0.8182, 1.739, 0.84, 2.0}}) {
    for (const double rotor_time_constant_s : {0.05, 0.2}) {
      const Rated found = rated(Circle(terminal_equivalent({.pole_pairs = c.pole_pairs,
                                                            .stator_resistance_ohm = 1.0,
                                                            .stator_inductance_h = 0.2,
                                                            .leakage_factor = c.leakage,
                                                            .rotor_time_constant_s = rotor_time_constant_s,
                                                            .star = true})));
      EXPECT_NEAR(found.slip / found.pull_slip, c.slip, 1e-3 * c.slip);
      EXPECT_NEAR(found.no_load, c.slip, 1e-3 * c.slip);
      EXPECT_NEAR(found.factor, c.factor, 1e-3 * c.factor);
      EXPECT_NEAR(found.pull_torque, c.pull_torque, 1e-3 * c.pull_torque);
      EXPECT_NEAR(found.pull_slip, 1.0 / (c.leakage * kLine_rad_s * rotor_time_constant_s), 1e-6);
      EXPECT_NEAR(found.factor, c.measured_factor, 0.15 * c.measured_factor);
      EXPECT_NEAR(found.pull_torque, c.measured_torque, 0.15 * c.measured_torque);
    }
  }
}

// Problem 7.17: the motor IM-A at 80 V rms a phase; the vectors are sqrt(3) times that. Half a unit of the
// last digit of the reference. Catches: a torque without n_p, a phase quantity that is not the vector over
// sqrt(3).
TEST(BookInductionRated, TheCircleOfMotorAIsThatOfProblem717) {
  const Circle machine(motor_of("im-a"));
  const Rated found = rated(machine);
  const auto phase_a = [&](double slip) { return 80.0 * machine.at(slip).current_a; };
  const double no_load_a = std::abs(phase_a(0.0));
  EXPECT_NEAR(found.pull_slip, 2.45019, 1e-5);
  EXPECT_NEAR(found.slip, 1.34556, 1e-5);
  EXPECT_NEAR(found.factor, 0.536592, 1e-6);
  EXPECT_NEAR(no_load_a, 15.1576, 1e-4);
  EXPECT_NEAR(std::abs(phase_a(found.slip)), 27.6012, 1e-4);
  EXPECT_NEAR(std::abs(phase_a(1e9)), 50.2604, 1e-4);
  EXPECT_NEAR(3.0 * 80.0 * 80.0 * machine.torque_nm(found.pull_slip), 33.5207, 1e-4);
  EXPECT_NEAR(1.0 / found.pull_torque, 0.843842, 1e-6);
  for (const double slip : {-3.0, 0.1, 1.0, 7.0}) {
    const Complex i = phase_a(slip) / no_load_a;
    EXPECT_NEAR(std::abs(i - Complex(0.0, -2.157926)), 1.157926, 1e-6) << slip;
  }
}

// AC-25: pull-out slip and torque of one rotating field of IM-C on a single phase, whose vector is half of
// 120 V times sqrt(2), with n_p = 1 as printed. Catches: a field of the wrong size.
TEST(BookInductionRated, OneFieldOfMotorCHasThePullOutOfTheReference) {
  const Circle machine(motor_of("im-c"));
  const Rated found = rated(machine);
  const double vector_v = 0.5 * 120.0 * std::numbers::sqrt2;
  EXPECT_NEAR(found.pull_slip, 0.09103, 5e-6);
  EXPECT_NEAR(vector_v * vector_v * machine.torque_nm(found.pull_slip) / 2.0, 1.2874, 5e-5);
}

// AC-20: the leakage of the motors as shipped, 1e-4, and kappa^2 = 1 - sigma. Catches: a motor file with an
// inductance that is not the book's.
TEST(BookInductionRated, TheShippedMotorsHaveTheLeakageOfTheReference) {
  for (const auto& [bench, sigma] : {std::pair{"im-a", 0.30158}, {"im-b", 0.14967}, {"im-c", 0.111364}}) {
    const InductionMachineParameters p = motor_of(bench);
    EXPECT_NEAR(leakage_factor(p), sigma, 1e-4) << bench;
    EXPECT_NEAR(
        p.mutual_inductance_h * p.mutual_inductance_h / (p.stator_inductance_h * p.rotor_inductance_h),
        1.0 - leakage_factor(p), 1e-12)
        << bench;
  }
}

}  // namespace
}  // namespace drivebench::induction_rated_test
