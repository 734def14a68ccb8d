#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <vector>

#include "tests/book/book_bench.hpp"

/// The error of the plant's steps against an adaptive method of order eight with a tolerance of 1e-13, which
/// is Boost's and independent of the drive train. Its output is the table in plant/README.md.
namespace drivebench::step_size_test {
namespace {

/// A motor on a sinusoidal (or DC) source from rest.
struct Study {
  const char* bench;
  double amplitude_v;
  double frequency_hz;
  double field_v;
  double end_s;
};

constexpr auto kStudies = std::to_array<Study>({
    {"servo", 80.0, 60.0, 0.0, 0.2},
    {"im-a", 60.0, 60.0, 0.0, 0.2},
    {"im-b", 169.83, 60.0, 0.0, 0.4},
    {"im-c", 169.71, 60.0, 0.0, 0.4},
    {"im-8-5-5", 381.06, 50.0, 0.0, 0.2},
    {"im-8-5-6", 187.79, 60.0, 0.0, 0.2},
    {"dc-a", 10.0, 0.0, 0.0, 0.1},
    {"dc-9-1-4", 40.0, 0.0, 0.0, 0.1},
    {"dc-separate", 220.0, 0.0, 220.0, 0.4},
    {"dc-shunt", 220.0, 0.0, 0.0, 0.4},
    {"dc-series", 220.0, 0.0, 0.0, 0.4},
    {"linear-dc", 10.0, 0.0, 0.0, 1.0},
    {"pm-stepper", 3.3, 50.0, 0.0, 0.2},
    {"pm-9-3", 6.0, 50.0, 0.0, 0.2},
    {"bm500", 10.0, 20.0, 0.0, 0.2},
    {"bldc", 33.0, 10.0, 0.0, 0.2},
    {"wound-rotor", 100.0, 10.0, 40.0, 0.2},
});

BenchConfig config_of(const Study& study) {
  BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + study.bench + ".toml");
  config.axes[0].events.clear();
  AxisParameters& p = config.setup.axes[0].parameters;
  p.drive = {};
  p.drive.kind = DriveKind::kSource;
  p.drive.amplifier = {.voltage_limit_v = 1000.0, .over_current_a = 1e6, .over_current_trip = false};
  p.drive.source.amplitude_v = study.amplitude_v;
  p.drive.source.frequency_hz = study.frequency_hz;
  p.drive.source.field_v = study.field_v;
  p.mechanics = {.inertia_kgm2 = p.mechanics.inertia_kgm2,
                 .viscous_friction_nms = p.mechanics.viscous_friction_nms};
  p.thermal.enabled = false;
  return config;
}

/// The compared values: currents of the windings, and the speed.
using Outcome = std::array<double, 5>;

Outcome outcome(const WindingValues& i, double speed_rad_s) {
  return {i.stator.a, i.stator.b, i.zero, i.field, speed_rad_s};
}

template <class Machine>
struct Reference {
  using Vector = std::vector<double>;
  static constexpr std::size_t kWords = sizeof(typename Machine::State) / sizeof(double);

  typename Machine::Parameters p;
  typename Machine::Constants c = constants_of(p);
  ShaftConstants shaft;
  Connection connection = connection_of(p);
  Study study;

  RotorMotion motion(const Vector& x) const {
    const double angle = pole_pairs_of(p) * x[kWords + 1];
    return {x[kWords + 1], x[kWords], {std::cos(angle), std::sin(angle)}};
  }
  static typename Machine::State machine(const Vector& x) {
    std::array<double, kWords> words;
    std::copy_n(x.begin(), kWords, words.begin());
    return std::bit_cast<typename Machine::State>(words);
  }

  void operator()(const Vector& x, Vector& slope, double t) const {
    const double lag =
        connection == Connection::kTwoPhase ? std::numbers::pi / 2.0 : 2.0 * std::numbers::pi / 3.0;
    const double phase = 2.0 * std::numbers::pi * study.frequency_hz * t;
    const auto volts = [&](int k) { return study.amplitude_v * std::cos(phase - k * lag); };
    const WindingVoltages v = winding_voltages(connection, {volts(0), volts(1), volts(2)});
    const TerminalInput u{.voltage_v = v.stator_v, .zero_v = v.zero_v, .field_v = study.field_v};
    const RotorMotion m = motion(x);
    const auto d = std::bit_cast<std::array<double, kWords>>(derivative(c, machine(x), m, u));
    std::copy(d.begin(), d.end(), slope.begin());
    const ShaftState s = derivative(shaft, ShaftState{.speed_rad_s = x[kWords], .angle_rad = x[kWords + 1]},
                                    torque_nm(c, machine(x), m), 0.0, ShaftBranch{});
    slope[kWords] = s.speed_rad_s;
    slope[kWords + 1] = s.angle_rad;
  }

  Outcome at_end() const {
    using namespace boost::numeric::odeint;
    Vector x(kWords + 2, 0.0);
    auto stepper = make_controlled<runge_kutta_fehlberg78<Vector>>(1e-13, 1e-13);
    integrate_adaptive(stepper, std::cref(*this), x, 0.0, study.end_s, 1e-6);
    return outcome(winding_currents(c, machine(x), motion(x)), x[kWords]);
  }
};

Outcome reference_outcome(const Study& study, const AxisParameters& p) {
  const ShaftConstants shaft = constants_of(p.mechanics);
  return std::visit(
      [&]<class P>(const P& machine) -> Outcome {
        const auto solve = [&]<class Machine>() {
          return Reference<Machine>{.p = machine, .shaft = shaft, .study = study}.at_end();
        };
        if constexpr (std::is_same_v<P, InductionMachineParameters>)
          return solve.template operator()<InductionMachine>();
        if constexpr (std::is_same_v<P, PmMachineParameters>) return solve.template operator()<PmMachine>();
        if constexpr (std::is_same_v<P, BldcMachineParameters>)
          return solve.template operator()<BldcMachine>();
        if constexpr (std::is_same_v<P, WoundRotorMachineParameters>)
          return solve.template operator()<WoundRotorMachine>();
        if constexpr (std::is_same_v<P, PmDcMachineParameters>)
          return solve.template operator()<PmDcMachine>();
        if constexpr (std::is_same_v<P, SeparateDcMachineParameters>)
          return solve.template operator()<SeparateDcMachine>();
        if constexpr (std::is_same_v<P, ShuntDcMachineParameters>)
          return solve.template operator()<ShuntDcMachine>();
        if constexpr (std::is_same_v<P, SeriesDcMachineParameters>)
          return solve.template operator()<SeriesDcMachine>();
        if constexpr (std::is_same_v<P, LinearDcMachineParameters>)
          return solve.template operator()<LinearDcMachine>();
        ADD_FAILURE() << "no reference for " << study.bench;
        return {};
      },
      p.machine);
}

/// Largest difference between plant and reference, relative to the size of currents and speed.
double error_of(const Study& study, const AxisParameters& p, double period_s, int substeps,
                const Outcome& exact) {
  Axis axis(p, {.period_s = period_s, .substeps = substeps}, 1, 0);
  const Tick ticks = std::lround(study.end_s / period_s);
  for (Tick tick = 0; tick < ticks; ++tick)
    axis.advance({}, tick);
  const Sample s = axis.sample(ticks);
  WindingValues windings{.stator = {s.true_i_a_a, s.true_i_b_a}, .field = s.true_i_f_a};
  if (axis.connection() == Connection::kStar) {
    windings.stator = three_to_two({s.true_i_a_a, s.true_i_b_a, s.true_i_c_a});
  }
  const Outcome plant = outcome(windings, s.speed_rad_s);
  const double current = std::max({std::hypot(exact[0], exact[1]), std::abs(exact[3]), 0.1});
  double worst = std::abs(plant[4] - exact[4]) / std::max(std::abs(exact[4]), 1.0);
  for (std::size_t k = 0; k < 4; ++k)
    worst = std::max(worst, std::abs(plant[k] - exact[k]) / current);
  return worst;
}

std::string scientific(double x) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1e", x);
  return text.data();
}

// Every shipped motor keeps 1e-6 at its default substep. Catches: a method of lower order, inputs that are
// held over a step although they change, a default substep that does not resolve the motor.
TEST(StepSize, EveryMotorIsExactAtItsDefaultSubstep) {
  std::printf(
      "| motor | tick | default substep | error | at half of it | at twice |\n|---|---|---|---|---|---|\n");
  for (const Study& study : kStudies) {
    const BenchConfig config = config_of(study);
    const AxisParameters& p = config.setup.axes[0].parameters;
    const double period_s = static_cast<double>(config.setup.period_ns) * 1e-9;
    const Outcome exact = reference_outcome(study, p);
    const BenchConfig shipped =
        load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + study.bench + ".toml");
    const int n = shipped.setup.substeps;
    const double error = error_of(study, p, period_s, n, exact);
    const double fine = error_of(study, p, period_s, std::min(2 * n, kMaxSubsteps), exact);
    const double coarse = error_of(study, p, period_s, std::max(n / 2, 1), exact);
    std::printf("| %s | %g us | %.3g us | %.1e | %.1e | %s |\n", study.bench, period_s * 1e6,
                period_s * 1e6 / n, error, fine, n > 1 ? scientific(coarse).c_str() : "-");
    EXPECT_LT(error, 1e-6) << study.bench;
    // The kinks of a curve or a trapezoid limit plant and reference to some 1e-7.
    EXPECT_LT(fine, std::max(0.5 * error, 5e-7)) << study.bench;
  }
}

/// A machine with a wound rotor on a source that is strong for it: up to its whole voltage at a thirtieth to
/// a tenth of its frequency, and up to five times its field.
struct Overdriven {
  Study study;
  AxisParameters p;
};

Overdriven overdriven(std::mt19937_64& random) {
  const auto between = [&random](double low, double high) {
    return low * std::pow(high / low, std::ldexp(static_cast<double>(random() >> 11), -53));
  };
  const double rated_v = between(20.0, 400.0);
  const double rated_rad_s = 2.0 * std::numbers::pi * between(10.0, 50.0);
  const double rated_a = between(1.0, 50.0);
  WoundRotorMachineParameters m;
  m.pole_pairs = static_cast<int>(between(1.0, 6.99));
  m.stator_resistance_ohm = between(0.02, 0.1) * rated_v / rated_a;
  m.stator_inductance_h = between(0.3, 1.5) * rated_v / (rated_rad_s * rated_a);
  m.field_resistance_ohm = between(0.5, 100.0);
  m.field_inductance_h = m.field_resistance_ohm * between(0.05, 1.0);
  m.mutual_inductance_h =
      std::sqrt((1.0 - between(0.05, 0.5)) * m.stator_inductance_h * m.field_inductance_h);
  const double rated_field_v = m.field_resistance_ohm * rated_v / (rated_rad_s * m.mutual_inductance_h);
  const double shaft_rad_s = rated_rad_s / m.pole_pairs;

  Overdriven x;
  x.study = {"overdriven", between(0.3, 1.0) * rated_v,
             between(0.03, 0.1) * rated_rad_s / (2.0 * std::numbers::pi), between(1.0, 5.0) * rated_field_v,
             0.2};
  x.p.machine = m;
  x.p.drive.kind = DriveKind::kSource;
  x.p.drive.amplifier = {.voltage_limit_v = 1000.0, .over_current_a = 1e9, .over_current_trip = false};
  x.p.drive.source.amplitude_v = x.study.amplitude_v;
  x.p.drive.source.frequency_hz = x.study.frequency_hz;
  x.p.drive.source.field_v = x.study.field_v;
  x.p.mechanics.inertia_kgm2 = between(0.03, 1.0) * rated_v * rated_a / (shaft_rad_s * shaft_rad_s);
  x.p.mechanics.viscous_friction_nms = between(0.01, 1.0) * x.p.mechanics.inertia_kgm2;
  return x;
}

// Wound rotors under overdrive keep 1e-5 at their default substep. Catches: a rule that resolves the windings
// but not the rotor, which swings about the stator's field: 2.1e-5 here without it.
TEST(StepSize, AWoundRotorUnderOverdriveIsExactAtItsDefaultSubstep) {
  constexpr double kPeriod_s = 1e-4;
  std::mt19937_64 random(18);
  double worst = 0.0;
  for (int k = 0; k < 100; ++k) {
    const Overdriven x = overdriven(random);
    const Outcome exact = reference_outcome(x.study, x.p);
    const double error = error_of(x.study, x.p, kPeriod_s, default_substeps(x.p, kPeriod_s), exact);
    EXPECT_LT(error, 1e-5) << k;
    worst = std::max(worst, error);
  }
  std::printf("worst of 100 wound rotors under overdrive: %.1e\n", worst);
}

/// A PM machine behind the output filter of its amplifier, y' = 2 pi f (u - y), whose command turns by a step
/// in each tick.
class FilteredStudy {
 public:
  explicit FilteredStudy(const AxisParameters& p, double period_s)
      : p_(p),
        machine_(std::get<PmMachineParameters>(p.machine)),
        c_(constants_of(machine_)),
        shaft_(constants_of(p.mechanics)),
        period_s_(period_s) {}

  Outcome exact() const {
    using namespace boost::numeric::odeint;
    std::vector<double> x(kWords + 4, 0.0);
    for (Tick tick = 0; tick < kTicks; ++tick) {
      const PhaseValues u = command(tick).setpoint;
      auto stepper = make_controlled<runge_kutta_fehlberg78<std::vector<double>>>(1e-13, 1e-13);
      integrate_adaptive(
          stepper,
          [&](const std::vector<double>& at, std::vector<double>& slope, double) { fill(at, u, slope); }, x,
          0.0, period_s_, 1e-6);
    }
    return outcome(winding_currents(c_, state_of(x), motion_of(x)), x[kWords]);
  }
  double error(int substeps, const Outcome& exact) const {
    Axis axis(p_, {.period_s = period_s_, .substeps = substeps}, 1, 0);
    for (Tick tick = 0; tick < kTicks; ++tick)
      axis.advance(command(tick), tick);
    const Sample s = axis.sample(kTicks);
    const double current_a = std::hypot(exact[0], exact[1]);
    return std::max({std::abs(s.true_i_a_a - exact[0]) / current_a,
                     std::abs(s.true_i_b_a - exact[1]) / current_a,
                     std::abs(s.speed_rad_s - exact[4]) / std::abs(exact[4])});
  }

 private:
  static constexpr Tick kTicks = 5000;
  static constexpr std::size_t kWords = sizeof(PmMachineState) / sizeof(double);

  PhaseCommand command(Tick tick) const {
    const double angle = 2.0 * std::numbers::pi * 50.0 * static_cast<double>(tick) * period_s_;
    return {.gates = Gates::kVoltage, .setpoint = {.a = 6.0 * std::cos(angle), .b = 6.0 * std::sin(angle)}};
  }
  RotorMotion motion_of(const std::vector<double>& x) const {
    const double angle = machine_.pole_pairs * x[kWords + 1];
    return {x[kWords + 1], x[kWords], {std::cos(angle), std::sin(angle)}};
  }
  static PmMachineState state_of(const std::vector<double>& x) {
    std::array<double, kWords> words;
    std::copy_n(x.begin(), kWords, words.begin());
    return std::bit_cast<PmMachineState>(words);
  }
  void fill(const std::vector<double>& x, const PhaseValues& u, std::vector<double>& slope) const {
    const double rate_per_s = 2.0 * std::numbers::pi * p_.drive.amplifier.filter_hz;
    const RotorMotion motion = motion_of(x);
    const TerminalInput filtered{.voltage_v = {x[kWords + 2], x[kWords + 3]}};
    const auto d = std::bit_cast<std::array<double, kWords>>(derivative(c_, state_of(x), motion, filtered));
    std::copy(d.begin(), d.end(), slope.begin());
    const ShaftState s = derivative(shaft_, ShaftState{.speed_rad_s = x[kWords], .angle_rad = x[kWords + 1]},
                                    torque_nm(c_, state_of(x), motion), 0.0, ShaftBranch{});
    slope[kWords] = s.speed_rad_s;
    slope[kWords + 1] = s.angle_rad;
    slope[kWords + 2] = rate_per_s * (u.a - x[kWords + 2]);
    slope[kWords + 3] = rate_per_s * (u.b - x[kWords + 3]);
  }

  AxisParameters p_;
  PmMachineParameters machine_;
  PmMachineConstants c_;
  ShaftConstants shaft_;
  double period_s_;
};

// Catches: a default substep that resolves the machine, but not the filter before it: 3.7e-6 here in steps of
// a tick.
TEST(StepSize, AFilteredAmplifierIsExactAtItsDefaultSubstep) {
  const BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/pm-9-3.toml");
  AxisParameters p = config.setup.axes[0].parameters;
  p.drive.amplifier.delay_ticks = 0.0;
  p.mechanics = {.inertia_kgm2 = p.mechanics.inertia_kgm2,
                 .viscous_friction_nms = p.mechanics.viscous_friction_nms};
  const double period_s = static_cast<double>(config.setup.period_ns) * 1e-9;
  const FilteredStudy study(p, period_s);
  const Outcome exact = study.exact();
  const int n = config.setup.substeps;
  std::printf("| pm-9-3 behind its filter | %g us | %.3g us | %.1e | %.1e | %.1e |\n", period_s * 1e6,
              period_s * 1e6 / n, study.error(n, exact), study.error(2 * n, exact),
              study.error(std::max(n / 2, 1), exact));
  EXPECT_LT(study.error(n, exact), 1e-6);
}

}  // namespace
}  // namespace drivebench::step_size_test
