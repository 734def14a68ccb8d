// An induction motor from its nameplate, and its equivalent circuit or the classical tests.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <span>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/datasheet/motor_kind.hpp"
#include "clients/identification/motors/classical_tests.hpp"
#include "clients/models/induction_circuit.hpp"
#include "clients/models/induction_forms.hpp"

namespace drivebench::command {
namespace {

constexpr double kRootThree = std::numbers::sqrt3;

double per_star(double x, const Sheet& s) {
  return s.delta ? x / 3.0 : x;
}
double pulsation_rad_s(const Sheet& s) {
  return 2.0 * std::numbers::pi * s.at("rated-hz");
}

// ---- the nameplate ----

constexpr auto kHz = std::to_array<Form>({{"rated-hz", "Hz", "of the line", 1e-3, 1e5, as_it_is}});
constexpr auto kVolt = std::to_array<Form>({{"rated-v", "V rms", "line to line", 1e-3, 1e6, as_it_is}});
constexpr auto kAmpere = std::to_array<Form>({{"rated-a", "A rms", "of a line", 1e-6, 1e6, as_it_is}});
constexpr auto kWatt =
    std::to_array<Form>({{"rated-w", "W", "at the shaft; 1 hp is 745.7", 1e-3, 1e9, as_it_is}});

// ---- the equivalent circuit ----

constexpr auto kRotor = std::to_array<Form>(
    {{"rotor-ohm", "ohm", "R2 of a phase, seen from the stator", 1e-6, kMostGiven, as_it_is}});
constexpr auto kX1 = std::to_array<Form>(
    {{"stator-leakage-ohm", "ohm", "X1 of a phase at --rated-hz", 0.0, kMostGiven, as_it_is}});
constexpr auto kX2 = std::to_array<Form>(
    {{"rotor-leakage-ohm", "ohm", "X2 of a phase at --rated-hz", 0.0, kMostGiven, as_it_is}});
constexpr auto kXm = std::to_array<Form>(
    {{"magnetizing-ohm", "ohm", "Xm of a phase at --rated-hz", 1e-6, kMostGiven, as_it_is}});

// ---- the classical tests ----

constexpr auto kIdleV = std::to_array<Form>(
    {{"no-load-v", "V rms", "line to line, the shaft without load", 1e-3, kMostGiven, as_it_is}});
constexpr auto kIdleA =
    std::to_array<Form>({{"no-load-a", "A rms", "of a line", 1e-6, kMostGiven, as_it_is}});
constexpr auto kIdleW = std::to_array<Form>({{"no-load-w", "W", "of all phases", 0.0, 1e9, as_it_is}});
constexpr auto kHeldV =
    std::to_array<Form>({{"blocked-v", "V rms", "line to line, the rotor held", 1e-3, kMostGiven, as_it_is}});
constexpr auto kHeldA =
    std::to_array<Form>({{"blocked-a", "A rms", "of a line", 1e-6, kMostGiven, as_it_is}});
constexpr auto kHeldW = std::to_array<Form>({{"blocked-w", "W", "of all phases", 0.0, 1e9, as_it_is}});
constexpr auto kHeldHz =
    std::to_array<Form>({{"blocked-hz", "Hz", "of that test; without it --rated-hz", 1e-3, 1e5, as_it_is}});
constexpr auto kOther = std::to_array<Quantity>({{"", "frequency of the line", true, kHz},
                                                 {"", "rated voltage", false, kVolt},
                                                 {"", "rated current", false, kAmpere},
                                                 {"", "rated power", false, kWatt},
                                                 {"", "frequency of the blocked-rotor test", false, kHeldHz},
                                                 {"", "rotor resistance R2", false, kRotor},
                                                 {"", "stator leakage reactance X1", false, kX1},
                                                 {"", "rotor leakage reactance X2", false, kX2},
                                                 {"", "magnetising reactance Xm", false, kXm},
                                                 {"", "voltage of the no-load test", false, kIdleV},
                                                 {"", "current of the no-load test", false, kIdleA},
                                                 {"", "power of the no-load test", false, kIdleW},
                                                 {"", "voltage of the blocked-rotor test", false, kHeldV},
                                                 {"", "current of the blocked-rotor test", false, kHeldA},
                                                 {"", "power of the blocked-rotor test", false, kHeldW}});
// Either of the two makes the motor.
constexpr std::span<const Quantity> kCircuit = std::span(kOther).subspan(5, 4);
constexpr std::span<const Quantity> kTests = std::span(kOther).subspan(9, 6);

constexpr auto kStator = std::to_array<Form>({
    {"resistance-line-ohm", "ohm", "between two terminals, measured with DC", 1e-6, kMostGiven,
     [](double x, const Sheet&) { return x / 2.0; }, "{x} / 2",
     "Between two terminals lie two phases of the star in series; a delta measures the same as its star."},
    {"resistance-phase-ohm", "ohm", "R1 of a phase", 1e-6, kMostGiven, per_star, "{x}{third}",
     "A phase of the star has the resistance of the two-phase equivalent; a delta is a star of a third."},
});
constexpr auto kInductionPoles = std::to_array<Form>({
    kPolePairForms[0],
    kPolePairForms[1],
    {"rated-rpm", "rpm", "speed with the rated load, of which the pole pairs follow", 1e-3, 1e6,
     [](double x, const Sheet& s) { return std::floor(60.0 * s.at("rated-hz") / x); },
     "60 * {f} / {x}, rounded down", "The field turns a little faster than the rotor."},
});
constexpr auto kMachine = std::to_array<Quantity>(
    {{"pole_pairs", kPolePairs.title, true, kInductionPoles},
     {"stator_resistance_ohm", "resistance R_S of the two-phase equivalent", true, kStator}});

/// What the no-load test takes beside the copper, as a torque at the speed of the field.
double friction_of_test(double no_load_w, const Sheet& s) {
  const double copper_w = 3.0 * s.at("no-load-a") * s.at("no-load-a") * s.value("stator_resistance_ohm");
  if (copper_w > no_load_w)
    throw UsageError(
        fmt::format("--no-load-w is {:g} but the copper alone takes {:.4g} W of --no-load-a {:g}", no_load_w,
                    copper_w, s.at("no-load-a")));
  return (no_load_w - copper_w) * s.value("pole_pairs") / pulsation_rad_s(s);
}
constexpr auto kShaftFriction = std::to_array<Form>({
    {"friction-nm", "N*m", "of bearings and fan, at every speed", 0.0, kMostGiven, as_it_is},
    {"no-load-w", "W", "of all phases in the test without load", 0.0, 1e9, friction_of_test,
     "({x} - 3 * {i}^2 * {r}) * {p} / (2 pi * {f})",
     "What the test takes beside the copper, iron included, as dry friction: the same torque at every speed.",
     true},
});
constexpr auto kShaft =
    std::to_array<Quantity>({kInertia, {"coulomb_friction_nm", "friction T_f", false, kShaftFriction}});

bool is_tested(const Sheet& s) {
  return std::ranges::any_of(kTests, [&](const Quantity& q) { return is_given(q, s); });
}

std::vector<Quantity> missing_of(const Sheet& s) {
  std::vector<Quantity> missing;
  std::ranges::copy_if(is_tested(s) ? kTests : kCircuit, std::back_inserter(missing),
                       [&](const Quantity& q) { return !is_given(q, s); });
  return missing;
}

/// The T circuit of a phase of the star.
InductionWindings from_circuit(const Sheet& s) {
  const auto henry = [&](std::string_view form) { return per_star(s.at(form), s) / pulsation_rad_s(s); };
  return windings_of(InductionTCircuit{.stator_resistance_ohm = s.value("stator_resistance_ohm"),
                                       .rotor_resistance_ohm = per_star(s.at("rotor-ohm"), s),
                                       .stator_leakage_h = henry("stator-leakage-ohm"),
                                       .rotor_leakage_h = henry("rotor-leakage-ohm"),
                                       .magnetizing_h = henry("magnetizing-ohm")});
}

/// A test as a power analyser reads it; voltage and current are those of a phase of the star.
identification::MeterReading reading_of(const Sheet& s, const std::string& test, double frequency_hz) {
  const double apparent_va = kRootThree * s.at(test + "-v") * s.at(test + "-a");
  const double active_w = s.at(test + "-w");
  if (active_w > apparent_va)
    throw UsageError(fmt::format("--{0}-w {1:g} is more than sqrt(3) V A of --{0}-v and --{0}-a, {2:.5g}{3}",
                                 test, active_w, apparent_va, likely_mistake(active_w / apparent_va)));
  return {.voltage_v = s.at(test + "-v") / kRootThree,
          .current_a = s.at(test + "-a"),
          .active_w = active_w,
          .reactive_var = std::sqrt(apparent_va * apparent_va - active_w * active_w),
          .frequency_hz = frequency_hz};
}

InductionWindings from_tests(const Sheet& s) {
  const double stator_ohm = s.value("stator_resistance_ohm");
  const auto tested =
      identification::motor_with_branch(stator_ohm, reading_of(s, "no-load", s.at("rated-hz")),
                                        reading_of(s, "blocked", s.at("blocked-hz", s.at("rated-hz"))));
  if (!tested)
    throw UsageError(
        fmt::format("no motor has these tests: with R_S = {:.4g} ohm the held rotor must take power beside "
                    "the copper of the "
                    "stator, and show less reactance than the motor without load",
                    stator_ohm));
  return {.stator_resistance_ohm = stator_ohm,
          .rotor_resistance_ohm = tested->rotor_resistance_ohm,
          .stator_inductance_h = tested->stator_inductance_h,
          .rotor_inductance_h = tested->stator_inductance_h,
          .mutual_inductance_h = tested->mutual_inductance_h};
}

std::vector<FileLine> circuit_lines(const InductionWindings& w, const Sheet& s) {
  const std::string third = s.delta ? " / 3" : "";
  const auto sum = [&](const char* leakage) {
    return fmt::format("({:.10g} + {:.10g}){} / (2 pi * {:g})", s.at("magnetizing-ohm"), s.at(leakage), third,
                       s.at("rated-hz"));
  };
  return {{.comment = {fmt::format(
               "rotor resistance R_R of the two-phase equivalent: {:.10g}{}   [--rotor-ohm, ohm]",
               s.at("rotor-ohm"), third)},
           .key = "rotor_resistance_ohm",
           .value = real(w.rotor_resistance_ohm)},
          {.comment = {"stator inductance L_S = (Xm + X1)/w: " + sum("stator-leakage-ohm")},
           .key = "stator_inductance_h",
           .value = real(w.stator_inductance_h)},
          {.comment = {"rotor inductance L_R = (Xm + X2)/w: " + sum("rotor-leakage-ohm")},
           .key = "rotor_inductance_h",
           .value = real(w.rotor_inductance_h)},
          {.comment = {fmt::format(
               "mutual inductance M = Xm/w: {:.10g}{} / (2 pi * {:g}); the power-invariant frame "
               "leaves the circuit of a phase as it is",
               s.at("magnetizing-ohm"), third, s.at("rated-hz"))},
           .key = "mutual_inductance_h",
           .value = real(w.mutual_inductance_h)}};
}

std::vector<FileLine> test_lines(const InductionWindings& w, const Sheet& s) {
  return {
      {.comment =
           {fmt::format("The blocked-rotor test ({:g} V, {:g} A, {:g} W, {:g} Hz) with the magnetising "
                        "branch left in:",
                        s.at("blocked-v"), s.at("blocked-a"), s.at("blocked-w"),
                        s.at("blocked-hz", s.at("rated-hz"))),
            "  (Z - R_S)/(j w L_S) = sigma + (1 - sigma)/(1 + j w T_R)   gives sigma and T_R = L_R/R_R;",
            "  Z = V/(sqrt(3) A) at the angle of the power. Leaving the branch out makes R_R too small by "
            "(M/L_R)^2."},
       .key = "rotor_resistance_ohm",
       .value = real(w.rotor_resistance_ohm)},
      {.comment = {fmt::format("The no-load test: L_S = Im Z/w from {:g} V, {:g} A, {:g} W at {:g} Hz.",
                               s.at("no-load-v"), s.at("no-load-a"), s.at("no-load-w"), s.at("rated-hz"))},
       .key = "stator_inductance_h",
       .value = real(w.stator_inductance_h)},
      {.comment = {"The tests see no turns of the rotor: equal leakages, L_R = L_S."},
       .key = "rotor_inductance_h",
       .value = real(w.rotor_inductance_h)},
      {.comment = {fmt::format("M = L_S sqrt(1 - sigma), sigma = {:.4g}", w.leakage())},
       .key = "mutual_inductance_h",
       .value = real(w.mutual_inductance_h)}};
}

std::vector<FileLine> induction_lines(Sheet& s) {
  const bool tested = is_tested(s);
  const InductionWindings w = tested ? from_tests(s) : from_circuit(s);
  if (!(w.leakage() > 0.0))
    throw UsageError("--stator-leakage-ohm and --rotor-leakage-ohm are both 0 but one must be above 0");
  s.made["rotor_resistance_ohm"] = w.rotor_resistance_ohm;
  s.made["stator_inductance_h"] = w.stator_inductance_h;
  s.made["rotor_inductance_h"] = w.rotor_inductance_h;
  s.made["mutual_inductance_h"] = w.mutual_inductance_h;
  return tested ? test_lines(w, s) : circuit_lines(w, s);
}

void compare(const char* what, const char* unit, double model, double nameplate,
             std::vector<std::string>& remarks) {
  constexpr double kFarOff = 1.5;
  const std::string both = fmt::format(
      "at the rated speed the model has {:.4g} {} of {}, the nameplate {:.4g}", model, unit, what, nameplate);
  if (model > kFarOff * nameplate || model < nameplate / kFarOff)
    throw UsageError(both + likely_mistake(model / nameplate));
  if (!agree(model, nameplate)) remarks.push_back(both);
}

std::vector<std::string> check_induction(const Sheet& s) {
  std::vector<std::string> remarks;
  if (!s.has("rated-rpm") || !s.has("rated-v")) return remarks;
  const InductionCircuit circuit = {
      .motor = {.machine = {.pole_pairs = s.value("pole_pairs"),
                            .mutual_inductance_h = s.value("mutual_inductance_h"),
                            .rotor_resistance_ohm = s.value("rotor_resistance_ohm"),
                            .rotor_inductance_h = s.value("rotor_inductance_h"),
                            .friction_nms = 0.0,
                            .inertia_kgm2 = s.value("inertia_kgm2")},
                .stator_resistance_ohm = s.value("stator_resistance_ohm"),
                .stator_inductance_h = s.value("stator_inductance_h")},
      .star = true,
      .voltage_v = s.at("rated-v") / kRootThree,
      .frequency_hz = s.at("rated-hz")};
  const double speed_rad_s = s.at("rated-rpm") * kRadPerRpm;
  const InductionCircuit::Point rated = circuit.at(1.0 - speed_rad_s / circuit.synchronous_rad_s());
  if (s.has("rated-w")) {
    const double wanted_nm = s.at("rated-w") / speed_rad_s + s.value("coulomb_friction_nm");
    const double pull_out_nm = circuit.at(circuit.pull_out_slip(InductionCircuit::Mode::kMotor)).torque_nm;
    if (pull_out_nm < wanted_nm)
      throw UsageError(fmt::format("the rated torque is {:.4g} N*m, but the motor pulls out at {:.4g}{}",
                                   wanted_nm, pull_out_nm, likely_mistake(pull_out_nm / wanted_nm)));
    compare("torque", "N*m", rated.torque_nm, wanted_nm, remarks);
  }
  if (s.has("rated-a")) compare("line current", "A", std::abs(rated.stator_a), s.at("rated-a"), remarks);
  return remarks;
}

}  // namespace

const MotorKind kInductionMotor = {
    .name = "im",
    .machine = "induction",
    .title =
        "a three-phase induction motor, from its equivalent circuit or from the tests without load and with "
        "the rotor held",
    .example =
        "--rated-hz 60 --rated-rpm 1165 --rated-v 208 --resistance-line-ohm 3.7 --rotor-ohm 2.1 "
        "--stator-leakage-ohm 7.16 --rotor-leakage-ohm 7.16 --magnetizing-ohm 84.8 --inertia-kgm2 0.0185",
    .phases = true,
    .machine_values = kMachine,
    .shaft_values = kShaft,
    .other_values = kOther,
    .missing = missing_of,
    .more_lines = induction_lines,
    .check = check_induction,
};

}  // namespace drivebench::command
