#include <functional>
#include <numbers>
#include <utility>

#include "clients/identification/motors/classical_tests.hpp"
#include "tests/book/results/results.hpp"
#include "tests/clients/identification/bench_data.hpp"

namespace drivebench {
namespace {

using namespace identification;
using TestRecorder = identification::Recorder;

/// A change of IM-B's bench for a test.
using Change = std::function<void(AxisParameters&)>;

/// The steady state of IM-B after 6 s without sensors, its last half second.
TerminalReading reading_of(Feed feed, const Change& change) {
  BenchConfig config = bench_config("im-b");
  change(config.setup.axes[0].parameters);
  BookBench run(config);
  run.run_until(5.0);
  TestRecorder record = line_recorder(run.period_s(), true);
  run.run_until(6.0, std::ref(record));
  Settings e{.kind = MotorKind::kInduction, .pole_pairs = 3};
  e.processing.voltage_shift = 0.0;
  e.processing.from_s = 0.5;
  return read_terminals(record.data(), e, feed);
}

TerminalReading with_dc() {
  return reading_of(Feed::kDc, [](AxisParameters& p) {
    p.drive.source.amplitude_v = 8.0;
    p.drive.source.frequency_hz = 0.0;
    p.drive.source.amplitude_factor_b = 2.0;
    p.drive.source.amplitude_factor_c = 0.0;
  });
}
TerminalReading without_load(double friction_nms) {
  return reading_of(Feed::kAc, [=](AxisParameters& p) { p.mechanics.viscous_friction_nms = friction_nms; });
}
TerminalReading held() {
  return reading_of(Feed::kAc, [](AxisParameters& p) { p.mechanics.motion = ShaftMotion::kLocked; });
}

const ClassicalTests& tests_of_im_b() {
  static const ClassicalTests tests = classical_tests(with_dc(), without_load(0.0), held());
  return tests;
}

/// Steady states have no chaos: a thousandth.
Measured steady(std::string what, double value, std::string unit) {
  return {std::move(what), value, std::move(unit), 1e-3 * std::abs(value) + 1e-9};
}

std::vector<Measured> parameters() {
  const identification::Result& found = tests_of_im_b().result;
  return {steady("R_S", found.at("R_S"), "ohm"), steady("L_S", found.at("L_S"), "H"),
          steady("R_R", found.at("R_R"), "ohm"), steady("L_S - M", found.at("L_S") - found.at("M"), "H"),
          steady("M", found.at("M"), "H"),       steady("sigma", found.at("sigma"), "")};
}

std::vector<Measured> errors() {
  const identification::Result& found = tests_of_im_b().result;
  constexpr double kSigma = 1.0 - 0.225 * 0.225 / (0.244 * 0.244);
  const auto error = [&](const char* name, double truth) {
    return Measured{name, 100.0 * (found.at(name) / truth - 1.0), "%", 0.02};
  };
  return {error("L_S", 0.244), error("R_R", 2.1), error("M", 0.225), error("sigma", kSigma),
          error("T_R", 0.244 / 2.1)};
}

std::vector<Measured> branch() {
  const TestedMotor motor = tests_of_im_b().with_branch.value();
  return {steady("R_R", motor.rotor_resistance_ohm, "ohm"), steady("M", motor.mutual_inductance_h, "H"),
          steady("sigma", motor.leakage_factor, ""), steady("T_R", motor.rotor_time_constant_s, "s")};
}

std::vector<Measured> powers() {
  const double no_load_w = without_load(0.0).meter.active_w;
  return {steady("blocked", held().meter.active_w, "W"), steady("no load", no_load_w, "W"),
          steady("with friction", without_load(5e-5).meter.active_w, "W")};
}

std::vector<Measured> friction() {
  const TerminalReading reading = without_load(5e-5);
  const TestedMotor motor = tests_of_im_b().with_branch.value();
  const NoLoadLosses losses = no_load_losses(reading, 1.85, 0.0, motor.leakage_factor);
  const double omega = 2.0 * std::numbers::pi * reading.meter.frequency_hz;
  return {number("slip from the power", losses.slip_angle / (omega * motor.rotor_time_constant_s), ""),
          steady("L_S", no_load_inductance_h(reading.meter), "H"),
          number("bias of L_S that the power tells", 100.0 * losses.inductance_bias, "%")};
}

}  // namespace

ResultSection classical_results() {
  return {
      "The classical tests of an induction motor (problem 7.19)",
      {{"AC-23",
        "DC, no-load and blocked-rotor test of IM-B at 208 V, `identify --experiment classical` without "
        "sensors",
        "derived L_S 0.244, R_R 1.7848, L_S - M 0.018314, M 0.225686, sigma 0.14448", parameters(), "agrees"},
       {"AC-23", "what these are off", "derived 0 %, −15.0 %, +0.30 %, −3.47 %", errors(),
        "agrees; the blocked test leaves out the magnetising branch: R_R times (M/L_R)²"},
       {"AC-23", "the same readings with the magnetising branch left in", "true 2.1, 0.225, 0.1497, 0.1162",
        branch(), "agrees"},
       {"AC-23", "power of the tests, the last with a friction of 5e-5 N m s",
        "derived 771.27, 9.455, 10.244 W", powers(), "agrees"},
       {"AC-23", "what this friction does to the no-load test", "derived slip 4.51e-5, L_S 0.243999",
        friction(), "agrees"}}};
}

}  // namespace drivebench
