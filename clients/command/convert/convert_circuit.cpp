#include <fmt/core.h>

#include <array>
#include <numbers>
#include <string>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/convert/convert.hpp"
#include "clients/models/induction_forms.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

/// A third for the phases of a delta, and the inductance of a reactance.
struct Units {
  double resistance = 1.0;
  double inductance = 1.0;
};

Units units_of(const ConvertCircuitOptions& o) {
  const double star = o.delta ? 1.0 / 3.0 : 1.0;
  return {.resistance = star, .inductance = o.hz ? star / (2.0 * std::numbers::pi * *o.hz) : star};
}

InductionWindings windings_of(const ConvertCircuitOptions& o) {
  const bool as_t_circuit = o.magnetizing.has_value();
  const bool as_windings = o.stator || o.rotor || o.mutual;
  if (as_t_circuit == as_windings || (as_windings && (o.stator_leakage || o.rotor_leakage))) {
    throw UsageError(
        "give --stator, --rotor and --mutual, or --magnetizing with --stator-leakage and --rotor-leakage");
  }
  if (as_windings && !(o.stator && o.rotor && o.mutual))
    throw UsageError("--stator, --rotor and --mutual belong together");
  const Units units = units_of(o);
  const double stator_ohm = o.stator_ohm * units.resistance;
  const double rotor_ohm = o.rotor_ohm * units.resistance;
  const auto inductance = [&](const std::optional<double>& value) {
    return value.value_or(0.0) * units.inductance;
  };
  const InductionWindings windings =
      as_t_circuit
          ? drivebench::windings_of(InductionTCircuit{.stator_resistance_ohm = stator_ohm,
                                                      .rotor_resistance_ohm = rotor_ohm,
                                                      .stator_leakage_h = inductance(o.stator_leakage),
                                                      .rotor_leakage_h = inductance(o.rotor_leakage),
                                                      .magnetizing_h = inductance(o.magnetizing)})
          : InductionWindings{.stator_resistance_ohm = stator_ohm,
                              .rotor_resistance_ohm = rotor_ohm,
                              .stator_inductance_h = inductance(o.stator),
                              .rotor_inductance_h = inductance(o.rotor),
                              .mutual_inductance_h = inductance(o.mutual)};
  if (!(windings.leakage() > 0.0)) {
    throw UsageError(fmt::format("the leakage sigma = 1 - M^2/(L_S L_R) is {:g} but must be positive",
                                 windings.leakage()));
  }
  return windings;
}

struct CircuitForm {
  const char* name;
  const char* key;
  InductionWindings windings;
};

std::array<CircuitForm, 4> forms_of(const InductionWindings& given) {
  return {{{"as given", "given", given},
           {"equal leakages", "equal_leakages", given.with_turns(given.turns_of_equal_leakages())},
           {"gamma", "gamma", given.with_turns(given.turns_of_gamma())},
           {"inverse gamma", "inverse_gamma", given.with_turns(given.turns_of_inverse_gamma())}}};
}

void print_json(const InductionWindings& given, const std::array<CircuitForm, 4>& forms) {
  Json out = {{"leakage", given.leakage()}, {"rotor_time_s", given.rotor_time_s()}};
  for (const CircuitForm& form : forms) {
    const InductionWindings& w = form.windings;
    const InductionTCircuit t = t_circuit_of(w);
    out[form.key] = {{"stator_resistance_ohm", w.stator_resistance_ohm},
                     {"rotor_resistance_ohm", w.rotor_resistance_ohm},
                     {"stator_inductance_h", w.stator_inductance_h},
                     {"rotor_inductance_h", w.rotor_inductance_h},
                     {"mutual_inductance_h", w.mutual_inductance_h},
                     {"stator_leakage_h", t.stator_leakage_h},
                     {"rotor_leakage_h", t.rotor_leakage_h}};
  }
  fmt::print("{}\n", json_text(out));
}

void print_table(const InductionWindings& given, const std::array<CircuitForm, 4>& forms) {
  fmt::print("one machine at its terminals; a phase of the star, or of the two-phase equivalent\n\n");
  constexpr const char* kRow = "{:<16}{:>12}{:>12}{:>12}{:>12}{:>12}{:>14}{:>13}\n";
  fmt::print(fmt::runtime(kRow), "", "R_S [ohm]", "R_R [ohm]", "L_S [mH]", "L_R [mH]", "M [mH]",
             "L_S - M [mH]", "L_R - M [mH]");
  for (const CircuitForm& form : forms) {
    const InductionWindings& w = form.windings;
    const InductionTCircuit t = t_circuit_of(w);
    const auto number = [](double value) { return fmt::format("{:.5g}", value); };
    const auto milli = [&](double value_h) {
      return number(std::abs(value_h) < 1e-15 ? 0.0 : 1e3 * value_h);
    };
    fmt::print(fmt::runtime(kRow), form.name, number(w.stator_resistance_ohm), number(w.rotor_resistance_ohm),
               milli(w.stator_inductance_h), milli(w.rotor_inductance_h), milli(w.mutual_inductance_h),
               milli(t.stator_leakage_h), milli(t.rotor_leakage_h));
  }
  const InductionWindings& equal = forms[1].windings;
  fmt::print("\nsigma {:.5g}, rotor time constant {:.5g} ms\n\n", given.leakage(),
             1e3 * given.rotor_time_s());
  fmt::print(
      "in a bench file, under [machine], with equal leakages:\n  stator_resistance_ohm = {:.6g}\n  "
      "rotor_resistance_ohm = {:.6g}\n"
      "  stator_inductance_h = {:.6g}\n  rotor_inductance_h = {:.6g}\n  mutual_inductance_h = {:.6g}\n",
      equal.stator_resistance_ohm, equal.rotor_resistance_ohm, equal.stator_inductance_h,
      equal.rotor_inductance_h, equal.mutual_inductance_h);
}

}  // namespace

int run_convert_circuit(const ConvertCircuitOptions& options) {
  const InductionWindings given = windings_of(options);
  const std::array<CircuitForm, 4> forms = forms_of(given);
  options.json ? print_json(given, forms) : print_table(given, forms);
  return kExitOk;
}

}  // namespace drivebench::command
