#include <benchmark/benchmark.h>
#include <fmt/core.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "plant/axis.hpp"
#include "plant/math/rk4.hpp"
#include "plant/math/rotated.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/benchmark/tick/bare_machines.hpp"

namespace drivebench::speed::machines {
namespace {

constexpr double kMaxStepRatio = 1.3;
constexpr int kStepsPerBatch = 2000;
constexpr int kBatchesPerRound = 40;
constexpr std::size_t kRounds = 10;
constexpr double kStepS = 25e-6;

/// The step of the drive train: machine and shaft as one vector, the electrical angle rotated.
template <class Machine>
struct PlantStep {
  struct Whole {
    typename Machine::State machine;
    ShaftState shaft;
  };

  typename Machine::Constants c;
  ShaftConstants shaft;
  double pole_pairs;
  TerminalInput u;
  ShaftBranch branch{};

  [[gnu::flatten]] void step(Whole& x, double step_s) const noexcept {
    CosSin start{1.0, 0.0};
    const double start_rad = x.shaft.angle_rad;
    if constexpr (Machine::kUsesAngle) start = cos_sin(pole_pairs * start_rad);
    x = rk4_step(x, step_s, [&](const Whole& s) noexcept -> Whole {
      RotorMotion motion{s.shaft.angle_rad, s.shaft.speed_rad_s, start};
      if constexpr (Machine::kUsesAngle) {
        motion.electrical = rotated(start, pole_pairs * (s.shaft.angle_rad - start_rad));
      }
      return {.machine = derivative(c, s.machine, motion, u),
              .shaft = derivative(shaft, s.shaft, torque_nm(c, s.machine, motion), 0.0, branch)};
    });
  }
};

struct Round {
  double plant_ns;
  double bare_ns;
};

template <class Step>
double batch_ns(Step step) {
  const std::int64_t begin = now_ns();
  for (int k = 0; k < kStepsPerBatch; ++k)
    step();
  return static_cast<double>(now_ns() - begin) / kStepsPerBatch;
}

/// Both integrate the same motor from rest at the same voltages; they must agree on the speed.
template <class Machine, class Bare>
Row race(const char* name, const AxisParameters& p, const TerminalInput& u, Bare bare) {
  const auto& machine = std::get<typename Machine::Parameters>(p.machine);
  const PlantStep<Machine> plant{.c = constants_of(machine),
                                 .shaft = constants_of(p.mechanics),
                                 .pole_pairs = pole_pairs_of(machine),
                                 .u = u};
  typename PlantStep<Machine>::Whole x{};
  typename Bare::State y{};
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] {
    std::vector<double> plant_ns;
    std::vector<double> bare_ns;
    for (int batch = 0; batch < kBatchesPerRound; ++batch) {
      plant_ns.push_back(batch_ns([&] {
        plant.step(x, kStepS);
        ::benchmark::DoNotOptimize(x);
      }));
      bare_ns.push_back(batch_ns([&] {
        if constexpr (Machine::kUsesAngle) bare.begin(y);
        y = Bare::Rk4::step(bare, y, kStepS);
        ::benchmark::DoNotOptimize(y);
      }));
    }
    return Round{.plant_ns = percentile(plant_ns, 0.5), .bare_ns = percentile(bare_ns, 0.5)};
  });
  if (!(std::abs(x.shaft.speed_rad_s - y.w) <= 1e-6 * (1.0 + std::abs(y.w)))) {
    throw std::runtime_error(fmt::format("{}: the bare machine turns at {} rad/s, the plant's at {}", name,
                                         y.w, x.shaft.speed_rad_s));
  }
  return {.name = fmt::format("step, {}", name),
          .unit = "ns",
          .measured = median(rounds.results, &Round::plant_ns),
          .floor = median(rounds.results, &Round::bare_ns),
          .limit = Limit{Limit::Kind::kRatioAtMost, kMaxStepRatio},
          .disturbance = rounds.disturbance,
          .note = "floor: the same equations in a straight line"};
}

AxisParameters axis_of(const std::string& bench) {
  return bench_config(bench).setup.axes[0].parameters;
}

std::vector<Row> steps() {
  const TerminalInput plane{.voltage_v = {2.0, 1.0}, .field_v = 40.0};
  const TerminalInput dc{.voltage_v = {10.0, 0.0}, .field_v = 100.0};
  const AxisParameters servo = axis_of("servo");
  const AxisParameters pm = axis_of("bm500");
  const AxisParameters bldc = axis_of("bldc");
  const AxisParameters wound = axis_of("wound-rotor");
  const AxisParameters pm_dc = axis_of("dc-a");
  AxisParameters separate = axis_of("dc-separate");
  const AxisParameters shunt = axis_of("dc-shunt");
  AxisParameters series = axis_of("dc-series");
  series.mechanics.fan_torque_nms2 = 0.0;
  const AxisParameters linear = axis_of("linear-dc");
  AxisParameters saturated = servo;
  saturated.machine = SaturatedInductionMachineParameters{
      .pole_pairs = 3,
      .stator_resistance_ohm = 1.7,
      .rotor_resistance_ohm = 3.9,
      .stator_leakage_h = 0.0023,
      .rotor_leakage_h = 0.0023,
      .magnetising_curve = Curve({{0.0, 0.0}, {2.0, 0.023}, {4.0, 0.043}, {8.0, 0.07}, {16.0, 0.09}})};
  auto& field = std::get<SeparateDcMachineParameters>(separate.machine);
  field.saturation_curve = {};  // the equations alone are compared
  field.field_inductance_h = 23.0;
  const auto field_dc = [](const auto& p, const MechanicsParameters& s, double rf, double u, double uf) {
    return BareFieldDc{p.armature_resistance_ohm,
                       1.0 / p.armature_inductance_h,
                       p.motor_constant,
                       rf,
                       1.0 / p.field_inductance_h,
                       u,
                       uf,
                       BareShaft(s)};
  };
  const auto& shunt_p = std::get<ShuntDcMachineParameters>(shunt.machine);
  return {
      race<InductionMachine>(
          "induction", servo, plane,
          BareInduction(std::get<InductionMachineParameters>(servo.machine), servo.mechanics, 2.0, 1.0)),
      race<SaturatedInductionMachine>(
          "saturated induction", saturated, plane,
          BareSaturatedInduction(std::get<SaturatedInductionMachineParameters>(saturated.machine),
                                 saturated.mechanics, 2.0, 1.0)),
      race<PmMachine>("PM synchronous", pm, plane,
                      BarePm(std::get<PmMachineParameters>(pm.machine), pm.mechanics, 2.0, 1.0)),
      race<BldcMachine>("BLDC", bldc, plane,
                        BareBldc(std::get<BldcMachineParameters>(bldc.machine), bldc.mechanics, 2.0, 1.0)),
      race<WoundRotorMachine>("wound rotor", wound, plane,
                              BareWoundRotor(std::get<WoundRotorMachineParameters>(wound.machine),
                                             wound.mechanics, 2.0, 1.0, 40.0)),
      race<PmDcMachine>("PM DC", pm_dc, dc,
                        BarePmDc(std::get<PmDcMachineParameters>(pm_dc.machine), pm_dc.mechanics, 10.0)),
      race<SeparateDcMachine>("separately excited DC", separate, dc,
                              field_dc(field, separate.mechanics, field.field_resistance_ohm, 10.0, 100.0)),
      race<ShuntDcMachine>(
          "shunt DC", shunt, dc,
          field_dc(shunt_p, shunt.mechanics, shunt_p.field_resistance_ohm + shunt_p.adjusting_resistance_ohm,
                   10.0, 10.0)),
      race<SeriesDcMachine>(
          "series DC", series, dc,
          BareSeriesDc(std::get<SeriesDcMachineParameters>(series.machine), series.mechanics, 10.0)),
      race<LinearDcMachine>(
          "linear DC", linear, dc,
          BarePmDc(std::get<LinearDcMachineParameters>(linear.machine), linear.mechanics, 10.0)),
  };
}

/// Nanoseconds of a tick of an axis, its sample included.
template <class Tick>
Row timed(const std::string& name, double period_s, double at_least_times, Tick tick,
          const std::string& note) {
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] {
    std::vector<double> ns;
    for (int batch = 0; batch < kBatchesPerRound; ++batch)
      ns.push_back(batch_ns(tick));
    return percentile(ns, 0.5);
  });
  const double ns = median(rounds.results, [](double x) { return x; });
  return {.name = name,
          .unit = "x real time",
          .measured = period_s * 1e9 / ns,
          .limit = Limit{Limit::Kind::kAtLeast, at_least_times},
          .disturbance = rounds.disturbance,
          .note = fmt::format("{:.0f} ns a tick of {:.0f} us; {}", ns, period_s * 1e6, note)};
}

void switch_all_sensors_on(AxisParameters& p) {
  const AnalogParameters analog{
      .enabled = true, .bits = 12, .full_scale = 1000.0, .noise_rms = 0.01, .filter_hz = 5000.0};
  SensorParameters& s = p.sensors;
  s.current.bits = 12;
  s.current.noise_rms_a = 0.01;
  s.current.filter_hz = 5000.0;
  s.voltage = s.neutral = s.bus = s.temperature = analog;
  s.tachometer.analog = s.resolver.analog = analog;
  s.hall.enabled = true;
  s.meter.enabled = true;
}

std::vector<Row> ticks() {
  std::vector<Row> rows;
  constexpr double kPeriodS = 100e-6;
  for (const char* bench : {"servo", "im-b", "pm-stepper", "bm500", "bldc", "wound-rotor", "dc-a",
                            "dc-separate", "dc-shunt", "dc-series", "linear-dc"}) {
    AxisParameters p = axis_of(bench);
    switch_all_sensors_on(p);
    if (p.drive.kind == DriveKind::kSwitched) {  // its edges have a row of their own
      const AmplifierParameters amplifier = p.drive.amplifier;
      p.drive = {};
      p.drive.amplifier = amplifier;
    }
    const int substeps = default_substeps(p, kPeriodS);
    Axis axis(p, {.period_s = kPeriodS, .substeps = substeps}, 1, 0);
    drivebench::Tick now = 0;
    rows.push_back(timed(
        fmt::format("all sensors, {}", bench), kPeriodS, 50.0,
        [&] {
          const double phase = 60.0 * kPeriodS * static_cast<double>(now);
          axis.advance({.gates = Gates::kVoltage,
                        .setpoint = {.a = 5.0 * std::cos(phase), .b = 5.0 * std::sin(phase)}},
                       now);
          ::benchmark::DoNotOptimize(axis.sample(++now));
        },
        fmt::format("{} substeps", substeps)));
  }
  return rows;
}

Row switched_period() {
  constexpr double kPeriodS = 100e-6;
  AxisParameters p = axis_of("bm500");
  p.drive.bus = {.voltage_v = 320.0};
  p.drive.inverter.dead_time_s = 0.0;
  p.sensors.resolver.analog.enabled = false;
  p.mechanics.viscous_friction_nms = 0.01;
  Axis axis(p, {.period_s = kPeriodS, .substeps = 10}, 1, 0);
  std::vector<PhaseCommand> turn(628);  // at 100 rad/s
  for (std::size_t k = 0; k < turn.size(); ++k) {
    const double phase = 2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(turn.size());
    turn[k] = {.gates = Gates::kVoltage,
               .setpoint = {.a = 5.0 * std::cos(phase),
                            .b = 5.0 * std::cos(phase - 2.0944),
                            .c = 5.0 * std::cos(phase + 2.0944)}};
  }
  drivebench::Tick now = 0;
  std::size_t next = 0;
  const Row row = timed(
      "", kPeriodS, 0.0,
      [&] {
        axis.advance(turn[next], now++);
        if (++next == turn.size()) next = 0;
      },
      "");
  return {.name = "PWM period, switched inverter",
          .unit = "us",
          .measured = kPeriodS * 1e6 / row.measured,
          .limit = Limit{Limit::Kind::kAtMost, 1.5},
          .disturbance = row.disturbance,
          .note = "BM500, 100 us, 10 substeps and 6 edges split exactly; a whole tick with encoder"};
}

Row dynamometer() {
  const BenchConfig config = bench_config("dynamometer");
  constexpr double kPeriodS = 100e-6;
  AxisParameters first_p = config.setup.axes[0].parameters;
  AxisParameters second_p = config.setup.axes[1].parameters;
  const int substeps = std::max(default_substeps(first_p, kPeriodS), default_substeps(second_p, kPeriodS));
  Axis first(first_p, {.period_s = kPeriodS, .substeps = substeps}, 1, 0);
  Axis second(second_p, {.period_s = kPeriodS, .substeps = substeps}, 1, 1);
  drivebench::Tick now = 0;
  return timed(
      "dynamometer", kPeriodS, 25.0,
      [&] {
        const double phase = 300.0 * kPeriodS * static_cast<double>(now);
        const PhaseCommand motor{.gates = Gates::kVoltage,
                                 .setpoint = {.a = 40.0 * std::cos(phase), .b = 40.0 * std::sin(phase)}};
        Axis::advance_pair(first, second, motor, {.gates = Gates::kCurrent, .setpoint = {.a = -0.5}}, now);
        ++now;
        ::benchmark::DoNotOptimize(first.sample(now));
        ::benchmark::DoNotOptimize(second.sample(now));
      },
      fmt::format("two axes, {} substeps", substeps));
}

}  // namespace

std::vector<Row> measure() {
  std::vector<Row> rows = steps();
  rows.push_back(switched_period());
  for (Row& row : ticks())
    rows.push_back(std::move(row));
  rows.push_back(dynamometer());
  return rows;
}

}  // namespace drivebench::speed::machines
