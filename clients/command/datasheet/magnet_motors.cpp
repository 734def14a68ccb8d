// Motors with magnets: DC, PM synchronous and brushless DC.
#include <fmt/core.h>

#include <array>
#include <numbers>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/datasheet/motor_kind.hpp"

namespace drivebench::command {
namespace {

constexpr double kRoot2 = std::numbers::sqrt2;
constexpr double kRoot3 = std::numbers::sqrt3;

double third(const Sheet& sheet) {
  return sheet.delta ? 1.0 / 3.0 : 1.0;
}
double torque_constant(const Sheet& sheet) {
  return sheet.value("torque_constant_nm_per_a");
}

// ---- DC ----

constexpr auto kDcResistance = std::to_array<Form>(
    {{"resistance-ohm", "ohm", "between the terminals, brushes included", 1e-6, kMostGiven, as_it_is}});
constexpr auto kDcInductance =
    std::to_array<Form>({{"inductance-mh", "mH", "between the terminals", 1e-6, kMostGiven,
                          [](double x, const Sheet&) { return 1e-3 * x; }, "{x} * 1e-3"}});
constexpr auto kDcConstant = std::to_array<Form>({
    {"kt", "N*m/A", "torque over current; 1000 mN*m/A are 1", 1e-9, kMostGiven, as_it_is, "{x}",
     "In N*m/A and V*s/rad torque and emf constant are one number."},
    {"kv", "rpm/V", "speed over voltage", 1e-3, 1e9,
     [](double x, const Sheet&) { return 1.0 / (kRadPerRpm * x); }, "60 / (2 pi * {x})",
     "In V*s/rad the emf constant is the torque constant in N*m/A."},
    {"ke", "V/1000rpm", "voltage over speed", 1e-6, kMostGiven,
     [](double x, const Sheet&) { return x / (1000.0 * kRadPerRpm); }, "{x} * 60 / (2 pi * 1000)",
     "In V*s/rad the emf constant is the torque constant in N*m/A."},
});
constexpr auto kDcMachine = std::to_array<Quantity>({
    {"armature_resistance_ohm", "resistance R", true, kDcResistance},
    {"armature_inductance_h", "inductance L", true, kDcInductance},
    {"torque_constant_nm_per_a", "torque constant K_T", true, kDcConstant},
});

constexpr std::string_view kLossWhy =
    "All of it counts as dry friction: the same torque at every speed, which holds a standing shaft too.";
constexpr Form kFrictionForm = {"friction-nm", "N*m",      "of bearings and brushes, at every speed",
                                0.0,           kMostGiven, as_it_is};
constexpr auto kDcFriction = std::to_array<Form>({
    kFrictionForm,
    {"no-load-a", "A", "current without load", 0.0, kMostGiven,
     [](double x, const Sheet& s) { return torque_constant(s) * x; }, "{k} * {x}", kLossWhy},
});
constexpr std::string_view kFrictionTitle = "friction T_f";
constexpr auto kDcShaft =
    std::to_array<Quantity>({kInertia, {"coulomb_friction_nm", kFrictionTitle, false, kDcFriction}});

/// The rated and the no-load point of a data sheet, which are only compared with the rest.
constexpr auto kRatedTorque = std::to_array<Form>({{"rated-nm", "N*m", "for checks", 1e-9, 1e9, as_it_is}});
constexpr auto kDcRatedCurrent = std::to_array<Form>({{"rated-a", "A", "for checks", 1e-6, 1e9, as_it_is}});
constexpr auto kRmsRatedCurrent =
    std::to_array<Form>({{"rated-a", "A rms", "of a line, for checks", 1e-6, 1e9, as_it_is}});
constexpr auto kNoLoadSpeed =
    std::to_array<Form>({{"no-load-rpm", "rpm", "at --no-load-v, for checks", 1e-3, 1e9, as_it_is}});
constexpr auto kDcNoLoadVoltage =
    std::to_array<Form>({{"no-load-v", "V", "of --no-load-rpm", 1e-3, 1e9, as_it_is}});
constexpr auto kRmsNoLoadVoltage =
    std::to_array<Form>({{"no-load-v", "V rms", "line to line, of --no-load-rpm", 1e-3, 1e9, as_it_is}});
constexpr auto kDcOther = std::to_array<Quantity>({{"", "rated torque", false, kRatedTorque},
                                                   {"", "rated current", false, kDcRatedCurrent},
                                                   {"", "no-load speed", false, kNoLoadSpeed},
                                                   {"", "no-load voltage", false, kDcNoLoadVoltage}});
std::vector<std::string> check_dc(const Sheet& s) {
  return check_magnet_motor(s, {.nm_per_a = torque_constant(s),
                                .v_s_per_rad = torque_constant(s),
                                .ohm = s.value("armature_resistance_ohm"),
                                .current = "A",
                                .voltage = "V"});
}

// ---- PM synchronous ----

constexpr auto kStatorResistance = std::to_array<Form>({
    {"resistance-line-ohm", "ohm", "between two terminals", 1e-6, kMostGiven,
     [](double x, const Sheet&) { return x / 2.0; }, "{x} / 2",
     "Between two terminals lie two phases of the star in series; a delta measures the same as its star."},
    {"resistance-phase-ohm", "ohm", "of a phase", 1e-6, kMostGiven,
     [](double x, const Sheet& s) { return third(s) * x; }, "{x}{third}",
     "A phase of the star has the resistance of the two-phase equivalent; a delta is a star of a third."},
});
constexpr std::string_view kSynchronousWhy =
    "The inductance of the two-phase equivalent is the synchronous one of a phase: its own and what the "
    "other "
    "two add.";
constexpr Form kLineInductance = {"inductance-line-mh",
                                  "mH",
                                  "between two terminals",
                                  1e-6,
                                  kMostGiven,
                                  [](double x, const Sheet&) { return 1e-3 * x / 2.0; },
                                  "{x} * 1e-3 / 2",
                                  kSynchronousWhy};
constexpr Form kLineInductanceSmall = {
    "inductance-line-uh", "uH",
    "the same",           1e-3,
    kMostGiven,           [](double x, const Sheet&) { return 1e-6 * x / 2.0; },
    "{x} * 1e-6 / 2",     kSynchronousWhy};
constexpr Form kPhaseInductance = {"inductance-phase-mh",
                                   "mH",
                                   "of a phase, the others included (synchronous)",
                                   1e-6,
                                   kMostGiven,
                                   [](double x, const Sheet& s) { return 1e-3 * third(s) * x; },
                                   "{x} * 1e-3{third}",
                                   kSynchronousWhy};
constexpr auto kPmInductance = std::to_array<Form>({
    kLineInductance,
    kLineInductanceSmall,
    kPhaseInductance,
    {"ld-mh", "mH", "along the magnet, of a motor with buried magnets", 1e-6, kMostGiven,
     [](double x, const Sheet& s) { return 1e-3 * third(s) * x; }, "{x} * 1e-3{third}", kSynchronousWhy},
});
constexpr auto kPmConstant = std::to_array<Form>({
    {"kt-rms", "N*m/A rms", "torque over the rms current of a line", 1e-9, kMostGiven,
     [](double x, const Sheet&) { return x / kRoot3; }, "{x} / sqrt(3)",
     "The power-invariant i_q is sqrt(3) times the rms current of a line, and the torque is K_m i_q."},
    {"kt-peak", "N*m/A peak", "torque over the peak current of a line", 1e-9, kMostGiven,
     [](double x, const Sheet&) { return x * kRoot2 / kRoot3; }, "{x} * sqrt(2/3)",
     "The power-invariant i_q is sqrt(3/2) times the peak current of a line: without it K_m is 22 % too "
     "large."},
    {"kv-peak", "rpm/V peak", "speed over the peak voltage from line to line", 1e-3, 1e9,
     [](double x, const Sheet&) { return 1.0 / (kRadPerRpm * x * kRoot2); }, "60 / (2 pi * {x}) / sqrt(2)",
     "The peak from line to line is sqrt(3) times that of a phase, which is sqrt(2/3) K_m times the speed."},
    {"kv-rms", "rpm/V rms", "speed over the rms voltage from line to line", 1e-3, 1e9,
     [](double x, const Sheet&) { return 1.0 / (kRadPerRpm * x); }, "60 / (2 pi * {x})",
     "The rms voltage from line to line is K_m times the speed."},
    {"ke-peak", "V peak/1000rpm", "from line to line", 1e-6, kMostGiven,
     [](double x, const Sheet&) { return x / (1000.0 * kRadPerRpm * kRoot2); },
     "{x} * 60 / (2 pi * 1000) / sqrt(2)",
     "The peak from line to line is sqrt(3) times that of a phase, which is sqrt(2/3) K_m times the speed."},
    {"ke-rms", "V rms/1000rpm", "from line to line", 1e-6, kMostGiven,
     [](double x, const Sheet&) { return x / (1000.0 * kRadPerRpm); }, "{x} * 60 / (2 pi * 1000)",
     "The rms voltage from line to line is K_m times the speed."},
    {"lambda-wb", "Wb", "peak flux of the magnet in a phase", 1e-9, kMostGiven,
     [](double x, const Sheet& s) {
       return kRoot3 / kRoot2 * s.value("pole_pairs") * x * (s.delta ? 1.0 / kRoot3 : 1.0);
     },
     "sqrt(3/2) * {p} * {x}{root3}",
     "n_p lambda is the peak voltage of a phase over speed; the power-invariant frame makes it sqrt(3/2) of "
     "that."},
});
constexpr auto kPmMachine = std::to_array<Quantity>({
    kPolePairs,
    {"stator_resistance_ohm", "resistance R_S of the two-phase equivalent", true, kStatorResistance},
    {"inductance_d_h", "inductance L_d of the two-phase equivalent", true, kPmInductance},
    {"torque_constant_nm_per_a", "torque constant K_m, power-invariant", true, kPmConstant},
});
constexpr auto kLq = std::to_array<Form>(
    {{"lq-mh", "mH", "across the magnet; without it the same as along it", 1e-6, kMostGiven,
      [](double x, const Sheet& s) { return 1e-3 * third(s) * x; }, "{x} * 1e-3{third}", kSynchronousWhy}});
constexpr Quantity kLqQuantity = {"inductance_q_h", "inductance L_q of the two-phase equivalent", false, kLq};
constexpr auto kPmFriction = std::to_array<Form>({
    kFrictionForm,
    {"no-load-a", "A rms", "current of a line without load", 0.0, kMostGiven,
     [](double x, const Sheet& s) { return kRoot3 * torque_constant(s) * x; }, "sqrt(3) * {k} * {x}",
     kLossWhy},
});
constexpr auto kPmShaft =
    std::to_array<Quantity>({kInertia, {"coulomb_friction_nm", kFrictionTitle, false, kPmFriction}});

constexpr auto kPmOther = std::to_array<Quantity>({{"", "rated torque", false, kRatedTorque},
                                                   {"", "rated current", false, kRmsRatedCurrent},
                                                   {"", "no-load speed", false, kNoLoadSpeed},
                                                   {"", "no-load voltage", false, kRmsNoLoadVoltage},
                                                   kLqQuantity});

std::vector<FileLine> pm_lines(Sheet& s) {
  std::vector<FileLine> lines;
  if (is_given(kLqQuantity, s)) {
    lines.push_back(line_of(kLqQuantity, s));
  } else {
    lines.push_back({.comment = {"A round rotor has L_q = L_d; --lq-mh says otherwise."},
                     .key = "inductance_q_h",
                     .value = real(s.value("inductance_d_h"))});
  }
  return lines;
}

std::vector<std::string> check_pm(const Sheet& s) {
  return check_magnet_motor(s, {.nm_per_a = kRoot3 * torque_constant(s),
                                .v_s_per_rad = torque_constant(s),
                                .ohm = kRoot3 * s.value("stator_resistance_ohm"),
                                .current = "A rms",
                                .voltage = "V rms from line to line"});
}

// ---- brushless DC, trapezoidal emf ----

constexpr std::string_view kBlockWhy =
    "Two phases in series carry the supply's current: each of them makes half of torque and voltage.";
constexpr auto kBldcInductance =
    std::to_array<Form>({kLineInductance, kLineInductanceSmall, kPhaseInductance});
constexpr auto kBldcConstant = std::to_array<Form>({
    {"kt", "N*m/A", "torque over the supply's current, block commutation", 1e-9, kMostGiven,
     [](double x, const Sheet&) { return x / 2.0; }, "{x} / 2", kBlockWhy},
    {"kv", "rpm/V", "speed over the supply's voltage, the flat top from line to line", 1e-3, 1e9,
     [](double x, const Sheet&) { return 1.0 / (kRadPerRpm * x * 2.0); }, "60 / (2 pi * {x}) / 2", kBlockWhy},
    {"ke", "V/1000rpm", "the flat top from line to line", 1e-6, kMostGiven,
     [](double x, const Sheet&) { return x / (1000.0 * kRadPerRpm * 2.0); }, "{x} * 60 / (2 pi * 1000) / 2",
     kBlockWhy},
});
constexpr auto kBldcMachine = std::to_array<Quantity>({
    kPolePairs,
    {"stator_resistance_ohm", "resistance R_S of a phase of the star", true, kStatorResistance},
    {"self_inductance_h", "inductance L_S + M of a phase of the star", true, kBldcInductance},
    {"torque_constant_nm_per_a", "torque constant tau_p of a phase", true, kBldcConstant},
});
constexpr auto kBldcFriction = std::to_array<Form>({
    kFrictionForm,
    {"no-load-a", "A", "current of the supply without load", 0.0, kMostGiven,
     [](double x, const Sheet& s) { return 2.0 * torque_constant(s) * x; }, "2 * {k} * {x}", kLossWhy},
});
constexpr auto kBldcShaft =
    std::to_array<Quantity>({kInertia, {"coulomb_friction_nm", kFrictionTitle, false, kBldcFriction}});

std::vector<FileLine> bldc_lines(Sheet&) {
  return {{.comment = {"A star sees only the sum L_S + M, all of which stands above."},
           .key = "mutual_inductance_h",
           .value = "0.0"}};
}

std::vector<std::string> check_bldc(const Sheet& s) {
  return check_magnet_motor(s, {.nm_per_a = 2.0 * torque_constant(s),
                                .v_s_per_rad = 2.0 * torque_constant(s),
                                .ohm = 2.0 * s.value("stator_resistance_ohm"),
                                .current = "A of the supply",
                                .voltage = "V of the supply"});
}

}  // namespace

std::vector<std::string> check_magnet_motor(const Sheet& s, const MagnetMotor& m) {
  std::vector<std::string> remarks;
  const double idle_a = s.at("no-load-a");
  if (s.has("rated-nm") && s.has("rated-a")) {
    const double nm = m.nm_per_a * (s.at("rated-a") - idle_a);
    const double wanted_nm = s.at("rated-nm");
    if (nm < wanted_nm && !agree(nm, wanted_nm))
      throw UsageError(fmt::format("--rated-a {:g} ({}) makes {:.4g} N*m, but --rated-nm is {:g}{}",
                                   s.at("rated-a"), m.current, nm, wanted_nm,
                                   likely_mistake(nm / wanted_nm)));
    if (!agree(nm, wanted_nm))
      remarks.push_back(fmt::format("--rated-a {:g} ({}) makes {:.4g} N*m, more than --rated-nm {:g}{}",
                                    s.at("rated-a"), m.current, nm, wanted_nm,
                                    likely_mistake(nm / wanted_nm)));
  }
  if (s.has("no-load-rpm") != s.has("no-load-v"))
    throw UsageError("--no-load-rpm and --no-load-v belong together");
  if (s.has("no-load-rpm")) {
    const double rpm = (s.at("no-load-v") - m.ohm * idle_a) / m.v_s_per_rad / kRadPerRpm;
    if (!agree(rpm, s.at("no-load-rpm")))
      throw UsageError(fmt::format("--no-load-v {:g} ({}) makes {:.5g} rpm, but --no-load-rpm is {:g}{}",
                                   s.at("no-load-v"), m.voltage, rpm, s.at("no-load-rpm"),
                                   likely_mistake(rpm / s.at("no-load-rpm"))));
  }
  return remarks;
}

const MotorKind kDcMotor = {
    .name = "dc",
    .machine = "pm_dc",
    .title = "a permanent-magnet DC motor with brushes",
    .example =
        "--resistance-ohm 2.07 --inductance-mh 0.62 --kt 0.0525 --inertia-gcm2 69.6 --no-load-a 0.0369",
    .phases = false,
    .machine_values = kDcMachine,
    .shaft_values = kDcShaft,
    .other_values = kDcOther,
    .missing = nothing_more,
    .more_lines = no_more_lines,
    .check = check_dc,
};

const MotorKind kPmMotor = {
    .name = "pm",
    .machine = "pm_synchronous",
    .title = "a synchronous motor with permanent magnets and a sinusoidal emf",
    .example =
        "--pole-pairs 4 --resistance-line-ohm 1.3 --inductance-line-mh 3.2 --kt-rms 0.52 "
        "--ke-rms 32 --inertia-kgcm2 0.33",
    .phases = true,
    .machine_values = kPmMachine,
    .shaft_values = kPmShaft,
    .other_values = kPmOther,
    .missing = nothing_more,
    .more_lines = pm_lines,
    .check = check_pm,
};

const MotorKind kBldcMotor = {
    .name = "bldc",
    .machine = "bldc",
    .title = "a brushless DC motor with a trapezoidal emf",
    .example =
        "--pole-pairs 4 --resistance-line-ohm 0.46 --inductance-line-mh 0.35 --kv 259 "
        "--inertia-gcm2 119 --no-load-a 0.234",
    .phases = true,
    .machine_values = kBldcMachine,
    .shaft_values = kBldcShaft,
    .other_values = kDcOther,
    .missing = nothing_more,
    .more_lines = bldc_lines,
    .check = check_bldc,
};

}  // namespace drivebench::command
