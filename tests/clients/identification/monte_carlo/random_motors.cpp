#include "tests/clients/identification/monte_carlo/random_motors.hpp"
#include "clients/identification/identify.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <string>

#include "plant/math/frames.hpp"
#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::identification {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

constexpr std::span<const Range> kNothing{};
constexpr std::array kDc = std::to_array<Range>({{"R", "ohm", 1.0, 4.0},
                                                 {"L", "H", 1e-3, 4e-3},
                                                 {"K_T", "N m/A", 0.035, 0.14},
                                                 {"J", "kg m^2", 3e-5, 1.2e-4},
                                                 {"f", "N m s/rad", 2e-4, 8e-4}});
constexpr std::array kInduction = std::to_array<Range>({{"R_S", "ohm", 4.85, 19.4},
                                                        {"T_R", "s", 0.04, 0.16},
                                                        {"L_S", "H", 0.4, 1.1},
                                                        {"sigma", "", 0.05, 0.15},
                                                        {"J", "kg m^2", 5.5e-3, 2.2e-2},
                                                        {"tau_L", "N m", 1.0, 4.0}});
constexpr std::array kInductionOthers = std::to_array<Range>({{"L_R/L_S", "", 0.9, 1.1},
                                                              {"pole pairs (rounded)", "", 1.0, 3.0},
                                                              {"phase of the line", "rad", 0.0, kTurn}});
constexpr std::array kSaturatedOthers =
    std::to_array<Range>({{"log L_R/L_S over log(1-sigma)", "", -0.7, 0.7},
                          {"pole pairs (rounded)", "", 1.0, 3.0},
                          {"phase of the line", "rad", 0.0, kTurn},
                          {"flux of twice the current", "Wb", 1.2, 6.0},
                          {"power of the curve", "", 2.0, 8.0}});
constexpr std::array kCurve = std::to_array<Range>({{"i_m at 31 %", "A", 0.0, 0.0},
                                                    {"i_m at 59 %", "A", 0.0, 0.0},
                                                    {"i_m at 81 %", "A", 0.0, 0.0},
                                                    {"i_m at 95 %", "A", 0.0, 0.0},
                                                    {"i_m at 100 %", "A", 0.0, 0.0}});
constexpr std::array kPm = std::to_array<Range>({{"R_S", "ohm", 0.3, 1.2},
                                                 {"L_S", "H", 1.2e-3, 4.8e-3},
                                                 {"K_m", "N m/A", 0.26, 1.03},
                                                 {"J", "kg m^2", 9.4e-5, 3.7e-4},
                                                 {"f", "N m s/rad", 1.6e-3, 6.4e-3},
                                                 {"f_c", "N m", 0.035, 0.14}});
constexpr std::array kBldc = std::to_array<Range>({{"R_S", "ohm", 0.35, 1.4},
                                                   {"L+M", "H", 1.4e-3, 5.6e-3},
                                                   {"tau_p", "N m/A", 0.26, 1.03},
                                                   {"J", "kg m^2", 1e-4, 4e-4},
                                                   {"f", "N m s/rad", 1e-3, 4e-3}});
constexpr std::array kSalient = std::to_array<Range>({{"R_S", "ohm", 0.175, 0.7},
                                                      {"L_d", "H", 0.9e-3, 2.5e-3},
                                                      {"L_q", "H", 2.8e-3, 8.4e-3},
                                                      {"K_m", "N m/A", 0.15, 0.6},
                                                      {"J", "kg m^2", 1.5e-4, 6e-4},
                                                      {"f", "N m s/rad", 1e-3, 4e-3},
                                                      {"f_c", "N m", 0.02, 0.08}});

constexpr std::array kDraws = std::to_array<MotorDraw>({
    {MotorKind::kDc, "DC motors", "dc-a-servo",
     "Voltage amplifier, a chirp of 12 V from 2 to 80 Hz within 1 s, at 10 kHz; encoder of 2000 counts, "
     "currents to 20 A, voltages to 25 V; filters 100 Hz, or what choose_shaft_filter() makes of them.",
     kDc, kNothing, 0.0},
    {MotorKind::kInduction, "Induction motors", "im-8-5-5",
     "Start from the line, 381 V peak per phase at 50 Hz, with the load from the beginning, at 20 kHz; the "
     "record ends 50 ms after 90 % of the synchronous speed, between 0.2 and 1 s. Encoder of 2048 counts, "
     "currents to twice the ratio of voltage and leakage reactance, voltages to 500 V; filters 200 Hz, of "
     "the shaft 100 Hz. Some motors of one pole pair are still far from their speed after 1 s: the worst "
     "rows "
     "are theirs.",
     kInduction, kInductionOthers, 1.0},
    {MotorKind::kPmSynchronous, "PM synchronous motors", "pm-9-3",
     "Voltage amplifier, two phases, 50 pole pairs; u_d = 0, u_q = 9 V and a chirp of 6 V from 2 to 18 Hz on "
     "top for 0.4 s, at 50 kHz, turned by the encoder of 8000 counts; currents to 20 A, voltages to 50 V; "
     "filters 500 Hz, of the shaft chosen from the data.",
     kPm, kNothing, 0.0},
    {MotorKind::kBldc, "Brushless DC motors", "bldc-servo",
     "Voltage amplifier, one pole pair; trapezoids in phase with the emf, a chirp of 25 V from 2 to 80 Hz "
     "within 1 s, at 20 kHz, turned by the encoder of 4096 counts; currents to 70 A, voltages to 50 V; "
     "filters 500 Hz, of the shaft chosen from the data. L_S is 95 % of L+M.",
     kBldc, kNothing, 0.0},
    {MotorKind::kPmSynchronous, "Salient PM synchronous motors", "ipm-servo",
     "Voltage amplifier, 4 pole pairs; u_q a chirp of 12 V from 2 to 20 Hz and u_d 1 V and a sine of 5 V at "
     "60 Hz for 0.6 s, at 10 kHz, turned by the encoder of 4096 counts; no detent torque; currents to 40 A, "
     "voltages to 50 V; filters 500 Hz, of the shaft chosen from the data. L_q is 1.1 to 9 times L_d.",
     kSalient, kNothing, 0.0, Iron::kSalient},
    {MotorKind::kInduction, "Induction motors in 0.2 s", "im-8-5-5",
     "The same motors and starts, but every record ends after 0.2 s, when those of one pole pair and those "
     "with much inertia are still far from their speed. At a slip close to 1 noise takes the place of T_R in "
     "the equations.",
     kInduction, kInductionOthers, 0.2},
});

constexpr MotorDraw kSaturatedDraw = {
    MotorKind::kInduction,
    "Saturated induction motors",
    "im-8-5-5",
    "The starts of the induction motors above with iron whose magnetising current is lambda/M (1 + "
    "(lambda/lambda_h)^n); the flux of the line is 1.5 Wb. T_R, L_S and sigma are those without flux, i_m "
    "is the "
    "magnetising current at parts of the record's largest flux, which is the last of them. Motors that the "
    "record "
    "does not tell from straight ones count as not stated. Each is identified once.",
    kInduction,
    kSaturatedOthers,
    1.0,
    Iron::kSaturated,
    kCurve};

double four_digits(double x) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", x);
  return std::strtod(text.data(), nullptr);
}

double drawn(const Range& range, double part) {
  if (range.low > 0.0) return four_digits(range.low * std::pow(range.high / range.low, part));
  return four_digits(range.low + part * (range.high - range.low));
}

/// Converters of 12 bits for currents and voltages, both with a noise of one step rms.
void put_sensors(AxisParameters& p, double current_a, double voltage_v, bool converts_voltages = true) {
  constexpr double kSteps = 2048.0;
  p.sensors.current.bits = 12;
  p.sensors.current.full_scale_a = current_a;
  p.sensors.current.noise_rms_a = current_a / kSteps;
  p.sensors.voltage.enabled = converts_voltages;
  p.sensors.voltage.bits = 12;
  p.sensors.voltage.full_scale = voltage_v;
  p.sensors.voltage.noise_rms = voltage_v / kSteps;
}

/// The bench files, read once.
const BenchConfig& base_of(const MotorDraw& draw) {
  static const std::map<std::string_view, BenchConfig> bases = [] {
    std::map<std::string_view, BenchConfig> loaded;
    for (const MotorDraw& each : kDraws)
      loaded.try_emplace(each.bench, bench_config(std::string(each.bench)));
    return loaded;
  }();
  return bases.at(draw.bench);
}

Recorded run_dc(BenchConfig config, const std::vector<double>& motor) {
  set_rate(config, 100'000, 10);
  AxisParameters& p = config.setup.axes[0].parameters;
  p.machine = PmDcMachineParameters{.armature_resistance_ohm = motor[0],
                                    .armature_inductance_h = motor[1],
                                    .torque_constant_nm_per_a = motor[2]};
  p.drive.kind = DriveKind::kVoltage;
  p.mechanics.inertia_kgm2 = motor[3];
  p.mechanics.viscous_friction_nms = motor[4];
  put_sensors(p, 20.0, 25.0);
  BookBench run(config);
  Recorder record({"i_a_a", "u_a_v", "encoder_count"}, run.period_s());
  run.control_until(1.0, [&](const Sample& s) {
    record(s);
    const double t = run.now_s();
    const double u = 12.0 * std::sin(kTurn * (2.0 + 39.0 * t) * t);
    return PhaseCommand{.gates = Gates::kVoltage, .setpoint = {.a = u}};
  });
  Settings e{.kind = MotorKind::kDc, .counts_per_revolution = 2000.0};
  e.processing = usual_processing(e.kind, run.period_s());
  choose_shaft_filter(record.data(), e);
  return {std::move(record.data()), e};
}

double rotor_inductance_h(const MotorDraw& draw, const std::vector<double>& motor) {
  return motor[2] * (draw.iron == Iron::kSaturated ? std::pow(1.0 - motor[3], motor[6]) : motor[6]);
}

InductionMachineParameters straight_machine(const std::vector<double>& motor, double rotor_h) {
  return {.pole_pairs = static_cast<int>(std::lround(motor[7])),
          .stator_resistance_ohm = motor[0],
          .rotor_resistance_ohm = rotor_h / motor[1],
          .stator_inductance_h = motor[2],
          .rotor_inductance_h = rotor_h,
          .mutual_inductance_h = std::sqrt((1.0 - motor[3]) * motor[2] * rotor_h),
          .star = true};
}

double magnetising_a(double mutual_h, double twice_wb, double power, double flux_wb) {
  return flux_wb / mutual_h * (1.0 + std::pow(flux_wb / twice_wb, power));
}

/// The same with a magnetising current that is twice as large as that of a straight line at the flux
/// `twice_wb`.
SaturatedInductionMachineParameters saturated_machine(const InductionMachineParameters& straight,
                                                      double twice_wb, double power) {
  constexpr int kPoints = 400;
  constexpr double kFarWb = 6.0;  // beyond the flux of every start
  const double mutual_h = straight.mutual_inductance_h;
  std::vector<CurvePoint> points;
  for (int k = 0; k <= kPoints; ++k) {
    const double flux_wb = kFarWb * k / kPoints;
    points.push_back({.x = magnetising_a(mutual_h, twice_wb, power, flux_wb), .y = flux_wb});
  }
  return {.pole_pairs = straight.pole_pairs,
          .stator_resistance_ohm = straight.stator_resistance_ohm,
          .rotor_resistance_ohm = straight.rotor_resistance_ohm,
          .stator_leakage_h = straight.stator_inductance_h - mutual_h,
          .rotor_leakage_h = straight.rotor_inductance_h - mutual_h,
          .magnetising_curve = Curve(std::move(points)),
          .star = true};
}

Recorded run_induction(BenchConfig config, const MotorDraw& draw, const std::vector<double>& motor) {
  constexpr double kAmplitude = 381.059;
  constexpr double kLine = kTurn * 50.0;
  set_rate(config, 50'000, 4);
  AxisParameters& p = config.setup.axes[0].parameters;
  const bool saturated = draw.iron == Iron::kSaturated;
  const InductionMachineParameters straight = straight_machine(motor, rotor_inductance_h(draw, motor));
  const int pole_pairs = straight.pole_pairs;
  if (saturated)
    p.machine = saturated_machine(straight, motor[9], motor[10]);
  else
    p.machine = straight;
  p.mechanics.inertia_kgm2 = motor[4];
  p.drive.source.phase_rad = motor[8];
  put_sensors(p, 2.0 * kAmplitude / (kLine * motor[3] * motor[2]), 500.0, draw.converts_voltages);
  config.axes[0].events = {{.tick = 0, .action = LoadChange{.load_nm = motor[5], .ramp_ticks = 0}}};
  BookBench run(config);
  Recorder record = line_recorder(run.period_s(), false);
  constexpr double kMarginS = 0.01;  // the equations keep away from the edge of the filters
  double end_s = draw.longest_s + kMarginS;
  while (run.now_s() < end_s) {
    run.bench().step();
    record(run.sample());
    if (run.sample().speed_rad_s > 0.9 * kLine / pole_pairs)
      end_s = std::min(end_s, std::max(run.now_s() + 0.05, 0.2 + kMarginS));
  }
  Settings e{.kind = MotorKind::kInduction,
             .pole_pairs = pole_pairs,
             .counts_per_revolution = 2048.0,
             .load = LoadModel::kConstant};
  e.processing = usual_processing(e.kind, run.period_s());
  e.processing.from_s = 0.005;
  e.processing.to_s = run.now_s() - kMarginS;
  return {std::move(record.data()), e};
}

Recorded run_pm(BenchConfig config, const MotorDraw& draw, const std::vector<double>& motor) {
  constexpr int kCounts = 8000;
  constexpr int kPolePairs = 50;
  AxisParameters& p = config.setup.axes[0].parameters;
  p.machine = PmMachineParameters{.pole_pairs = kPolePairs,
                                  .stator_resistance_ohm = motor[0],
                                  .inductance_d_h = motor[1],
                                  .inductance_q_h = motor[1],
                                  .torque_constant_nm_per_a = motor[2]};
  p.mechanics.inertia_kgm2 = motor[3];
  p.mechanics.viscous_friction_nms = motor[4];
  p.mechanics.coulomb_friction_nm = p.mechanics.static_friction_nm = motor[5];
  p.drive.amplifier.delay_ticks = 0.0;
  p.drive.amplifier.filter_hz = 0.0;
  p.encoder.counts_per_revolution = kCounts;
  put_sensors(p, 20.0, 50.0, draw.converts_voltages);
  BookBench run(config);
  Recorder record({"i_a_a", "i_b_a", "u_a_v", "u_b_v", "encoder_count"}, run.period_s());
  run.control_until(0.4, [&](const Sample& s) {
    record(s);
    const double angle = kPolePairs * kTurn * (static_cast<double>(s.encoder_count) + 0.5) / kCounts;
    const double t = run.now_s();
    const double u_q = 9.0 + 6.0 * std::sin(kTurn * (2.0 + 20.0 * t) * t);
    return PhaseCommand{.gates = Gates::kVoltage,
                        .setpoint = {.a = -u_q * std::sin(angle), .b = u_q * std::cos(angle)}};
  });
  Settings e{.kind = MotorKind::kPmSynchronous,
             .pole_pairs = kPolePairs,
             .three_phase = false,
             .counts_per_revolution = kCounts};
  e.processing = usual_processing(e.kind, run.period_s());
  choose_shaft_filter(record.data(), e);
  return {std::move(record.data()), e};
}

Recorded run_salient(BenchConfig config, const MotorDraw& draw, const std::vector<double>& motor) {
  constexpr int kCounts = 4096;
  constexpr int kPolePairs = 4;
  AxisParameters& p = config.setup.axes[0].parameters;
  p.machine = PmMachineParameters{.pole_pairs = kPolePairs,
                                  .stator_resistance_ohm = motor[0],
                                  .inductance_d_h = motor[1],
                                  .inductance_q_h = motor[2],
                                  .torque_constant_nm_per_a = motor[3],
                                  .star = true};
  p.mechanics.inertia_kgm2 = motor[4];
  p.mechanics.viscous_friction_nms = motor[5];
  p.mechanics.coulomb_friction_nm = p.mechanics.static_friction_nm = motor[6];
  p.encoder.counts_per_revolution = kCounts;
  put_sensors(p, 40.0, 50.0, draw.converts_voltages);
  BookBench run(config);
  Recorder record({"i_a_a", "i_b_a", "i_c_a", "u_a_v", "u_b_v", "u_c_v", "encoder_count"}, run.period_s());
  run.control_until(0.6, [&](const Sample& s) {
    record(s);
    const double angle = kPolePairs * kTurn * (static_cast<double>(s.encoder_count) + 0.5) / kCounts;
    const double t = run.now_s();
    const double u_d = 1.0 + 5.0 * std::sin(kTurn * 60.0 * t);
    const double u_q = 12.0 * std::sin(kTurn * (2.0 + 15.0 * t) * t);
    const auto [u_a, u_b, u_c] = two_to_three({.a = u_d * std::cos(angle) - u_q * std::sin(angle),
                                               .b = u_d * std::sin(angle) + u_q * std::cos(angle)});
    return PhaseCommand{.gates = Gates::kVoltage, .setpoint = {.a = u_a, .b = u_b, .c = u_c}};
  });
  Settings e{.kind = MotorKind::kPmSynchronous, .pole_pairs = kPolePairs, .counts_per_revolution = kCounts};
  e.processing = usual_processing(e.kind, run.period_s());
  choose_shaft_filter(record.data(), e);
  return {std::move(record.data()), e};
}

Recorded run_bldc(BenchConfig config, const std::vector<double>& motor) {
  constexpr int kCounts = 4096;
  set_rate(config, 50'000, 5);
  AxisParameters& p = config.setup.axes[0].parameters;
  p.drive.kind = DriveKind::kVoltage;
  p.machine = BldcMachineParameters{.pole_pairs = 1,
                                    .stator_resistance_ohm = motor[0],
                                    .self_inductance_h = 0.95 * motor[1],
                                    .mutual_inductance_h = 0.05 * motor[1],
                                    .torque_constant_nm_per_a = motor[2],
                                    .star = true};
  p.mechanics.inertia_kgm2 = motor[3];
  p.mechanics.viscous_friction_nms = motor[4];
  p.encoder.counts_per_revolution = kCounts;
  put_sensors(p, 70.0, 50.0);
  BookBench run(config);
  Recorder record({"i_a_a", "i_b_a", "i_c_a", "u_a_v", "u_b_v", "u_c_v", "encoder_count"}, run.period_s());
  run.control_until(1.0, [&](const Sample& s) {
    record(s);
    const double angle = kTurn * (static_cast<double>(s.encoder_count) + 0.5) / kCounts;
    const double t = run.now_s();
    const double u = 25.0 * std::sin(kTurn * (2.0 + 39.0 * t) * t);
    const auto phase = [&](int k) { return -u * trapezoid(angle - k * kTurn / 3.0); };
    return PhaseCommand{.gates = Gates::kVoltage, .setpoint = {.a = phase(0), .b = phase(1), .c = phase(2)}};
  });
  Settings e{.kind = MotorKind::kBldc, .pole_pairs = 1, .counts_per_revolution = kCounts};
  e.processing = usual_processing(e.kind, run.period_s());
  e.processing.from_s = 0.02;
  choose_shaft_filter(record.data(), e);
  return {std::move(record.data()), e};
}

}  // namespace

std::span<const MotorDraw> motor_draws() noexcept {
  return kDraws;
}

const MotorDraw& saturated_draw() noexcept {
  return kSaturatedDraw;
}

std::vector<double> draw_motor(const MotorDraw& draw, int number) {
  std::mt19937_64 engine(100'000 * (static_cast<std::uint64_t>(draw.kind) + 1) +
                         static_cast<std::uint64_t>(number));
  return draw_motor(draw, engine);
}

std::vector<double> draw_motor(const MotorDraw& draw, std::mt19937_64& engine) {
  std::vector<double> values;
  for (const std::span<const Range> ranges : {draw.identified, draw.others}) {
    for (const Range& range : ranges)
      values.push_back(drawn(range, static_cast<double>(engine() >> 11) * 0x1p-53));
  }
  return values;
}

Recorded record_motor(const MotorDraw& draw, int number, int noise) {
  return record_motor(draw, draw_motor(draw, number),
                      1000 * static_cast<std::uint64_t>(number) + static_cast<std::uint64_t>(noise));
}

Recorded record_motor(const MotorDraw& draw, const std::vector<double>& motor, std::uint64_t seed) {
  BenchConfig config = base_of(draw);
  config.setup.seed = seed;
  switch (draw.kind) {
    case MotorKind::kDc:
      return run_dc(std::move(config), motor);
    case MotorKind::kInduction:
      return run_induction(std::move(config), draw, motor);
    case MotorKind::kPmSynchronous:
      return draw.iron == Iron::kSalient ? run_salient(std::move(config), draw, motor)
                                         : run_pm(std::move(config), draw, motor);
    case MotorKind::kBldc:
      break;
  }
  return run_bldc(std::move(config), motor);
}

bool Finding::covered() const noexcept {
  return std::abs(estimate - truth) <= interval;
}

bool Finding::covered_by_index() const noexcept {
  return std::abs(by_equations - truth) <= index;
}

std::vector<Range> MotorDraw::rows() const {
  std::vector<Range> all(identified.begin(), identified.end());
  all.insert(all.end(), derived.begin(), derived.end());
  return all;
}

namespace {

Finding finding_of(const Result& found, const std::string& name, double truth) {
  const Estimate* const estimate = found.find(name);
  if (estimate == nullptr || found.is_unseen(name)) return {.truth = truth};
  return {.truth = truth,
          .by_equations = estimate->by_equations.value_or(estimate->value),
          .index = estimate->index,
          .estimate = estimate->value,
          .interval = estimate->interval.value_or(0.0),
          .stated = true};
}

}  // namespace

std::vector<Finding> findings_of(const MotorDraw& draw, const std::vector<double>& motor,
                                 const Result& found) {
  const bool curved = draw.iron == Iron::kSaturated;
  const Result nothing;
  const Result& stated = curved && found.curve_wb.empty() ? nothing : found;
  std::vector<Finding> findings;
  for (std::size_t k = 0; k < draw.identified.size(); ++k)
    findings.push_back(finding_of(stated, std::string(draw.identified[k].name), motor[k]));
  if (!curved) return findings;
  const double mutual_h = straight_machine(motor, rotor_inductance_h(draw, motor)).mutual_inductance_h;
  for (std::size_t k = 0; k < draw.derived.size(); ++k) {
    const double flux_wb = stated.curve_wb.empty() ? 0.0 : stated.curve_wb[k];
    findings.push_back(
        finding_of(stated, curve_name(flux_wb), magnetising_a(mutual_h, motor[9], motor[10], flux_wb)));
  }
  return findings;
}

std::vector<Finding> identify_motor(const MotorDraw& draw, int number, int noise) {
  const std::vector<double> motor = draw_motor(draw, number);
  try {
    const Recorded run = record_motor(draw, number, noise);
    return findings_of(draw, motor, identify(run.data, run.how));
  } catch (const IdentificationError&) {
    return findings_of(draw, motor, Result{});  // nothing is stated
  }
}

}  // namespace drivebench::identification
