#include "clients/identification/data/result.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "clients/identification/data/magnetising_curve.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::identification {
namespace {

std::string percent(double part, double of) {
  const double value = of == 0.0 ? HUGE_VAL : 100.0 * part / std::abs(of);
  if (!std::isfinite(value)) return "-";
  return std::abs(value) >= 1e4 ? fmt::format("{:.1e} %", value) : fmt::format("{:.3g} %", value);
}

const char* inside_text(const Result& result, const Estimate& e) {
  const std::optional<bool> inside = is_inside(result, e);
  return !inside ? "-" : *inside ? "yes" : "no";
}

nlohmann::json number(double x) {
  return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(nullptr);
}

/// A key of a motor file and its estimate.
struct Row {
  const char* key;
  double value;
  bool may_be_zero;
};

std::vector<Row> machine_rows(const Result& r) {
  if (r.kind == "induction") {
    const double inductance = r.at("L_S");
    return {{"stator_resistance_ohm", r.at("R_S"), false},
            {"rotor_resistance_ohm", r.at("R_R"), false},
            {"stator_inductance_h", inductance, false},
            {"rotor_inductance_h", inductance, false},
            {"mutual_inductance_h", r.at("M"), false}};
  }
  if (is_saturated(r)) {
    return {{"stator_resistance_ohm", r.at("R_S"), false},
            {"rotor_resistance_ohm", r.at("R_R"), false},
            {"stator_leakage_h", r.at("l_s"), false},
            {"rotor_leakage_h", r.at("l_r"), false}};
  }
  if (r.kind == "pm_synchronous") {
    return {{"stator_resistance_ohm", r.at("R_S"), false},
            {"inductance_d_h", r.at(is_salient(r) ? "L_d" : "L_S"), false},
            {"inductance_q_h", r.at(is_salient(r) ? "L_q" : "L_S"), false},
            {"torque_constant_nm_per_a", r.at("K_m"), false}};
  }
  if (r.kind == "bldc") {
    // The star shows L + M only; the whole of it as self-inductance has the same currents.
    return {{"stator_resistance_ohm", r.at("R_S"), false},
            {"self_inductance_h", r.at("L+M"), false},
            {"mutual_inductance_h", 0.0, true},
            {"torque_constant_nm_per_a", r.at("tau_p"), false}};
  }
  return {{"armature_resistance_ohm", r.at("R"), false},
          {"armature_inductance_h", r.at("L"), false},
          {"torque_constant_nm_per_a", r.at("K_T"), false}};
}

std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned char>(c));
      continue;
    }
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string real_text(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";  // TOML tells integers from reals
  return text;
}

/// The curve in so many equal steps of the flux that a straight line between two points is off by 0.1 % of
/// the current at most.
std::string curve_text(const MagnetisingCurve& curve) {
  constexpr int kSteps = 100;
  constexpr int kPerLine = 4;
  if (!curve.rises())
    throw IdentificationError("no motor file: the magnetising current found falls where the flux grows");
  std::string text = "magnetising_curve = [";
  for (int k = 0; k <= kSteps; ++k) {
    const double flux_wb = curve.largest_wb() * k / kSteps;
    text += fmt::format("{}[{}, {}],", k % kPerLine == 0 ? "\n  " : " ", real_text(curve.current_a(flux_wb)),
                        real_text(flux_wb));
  }
  return text + "\n]\n";
}

std::string line_of(const Row& row) {
  if (!std::isfinite(row.value) || row.value < 0.0 || (row.value == 0.0 && !row.may_be_zero))
    throw IdentificationError(
        fmt::format("no motor file: {} = {} is no value for a motor", row.key, row.value));
  return fmt::format("{} = {}\n", row.key, real_text(row.value));
}

}  // namespace

const Estimate* Result::find(std::string_view name) const noexcept {
  const auto found =
      std::find_if(parameters.begin(), parameters.end(), [&](const Estimate& e) { return e.name == name; });
  return found == parameters.end() ? nullptr : &*found;
}

Estimate* Result::find(std::string_view name) noexcept {
  return const_cast<Estimate*>(std::as_const(*this).find(name));
}

double Result::at(std::string_view name) const {
  if (const Estimate* estimate = find(name)) return estimate->value;
  throw IdentificationError(fmt::format("the result has no parameter {}", name));
}

bool Result::is_unseen(std::string_view name) const noexcept {
  return std::find(excitation.unseen.begin(), excitation.unseen.end(), name) != excitation.unseen.end();
}

std::string curve_name(double flux_wb) {
  return fmt::format("i_m({:g} Wb)", flux_wb);
}

bool is_saturated(const Result& result) noexcept {
  return !result.curve_wb.empty();
}

bool is_salient(const Result& result) noexcept {
  return result.find("L_d") != nullptr;
}

std::optional<bool> is_inside(const Result& result, const Estimate& e) noexcept {
  if (!e.truth || result.is_unseen(e.name)) return std::nullopt;
  return std::abs(e.value - *e.truth) <= e.interval.value_or(e.index);
}

void Result::compare(const std::map<std::string, double, std::less<>>& truth) {
  for (Estimate& e : parameters) {
    const auto known = truth.find(e.name);
    if (known != truth.end()) e.truth = known->second;
  }
}

EstimateText text_of(const Result& r, const Estimate& e) {
  EstimateText text;
  if (e.truth) text.truth = number_text(*e.truth);
  if (r.is_unseen(e.name)) {
    text.value = "not seen";
    return text;
  }
  text.value = number_text(e.value);
  if (e.interval) text.interval = percent(*e.interval, e.value);
  if (e.truth) text.error = percent(e.value - *e.truth, *e.truth);
  const double by_equations = e.by_equations.value_or(e.value);
  if (std::isfinite(by_equations)) text.by_equations = number_text(by_equations);
  text.index = percent(e.index, by_equations);
  return text;
}

namespace {

/// A value of a fact, as people say it.
std::string said(const WiringFact& fact, double value) {
  if (fact.name == "pole_pairs") return fmt::format("{:.0f}", value);
  if (fact.name == "direction") return value < 0.0 ? "against the phases" : "with the phases";
  return fmt::format("{:.3g} {}", value + 0.0, fact.unit);
}

}  // namespace

std::string wiring_text(const WiringFact& fact) {
  constexpr std::pair<std::string_view, std::string_view> kNames[] = {{"pole_pairs", "pole pairs"},
                                                                      {"direction", "encoder"},
                                                                      {"voltage_shift", "voltages"},
                                                                      {"zero", "zero of the encoder"}};
  std::string text;
  for (const auto& [key, name] : kNames) {
    if (key == fact.name) text = name;
  }
  if (fact.name == "voltage_shift") text += " advanced by";
  text += " " + said(fact, fact.used);
  if (!fact.found) {
    text += fact.given ? ", as set; " : ", assumed; ";
  } else if (fact.contradicts) {
    text += ", as set, BUT THE DATA SAY " + said(fact, *fact.found);
  } else {
    text += fact.given ? ", as set and found" : ", found";
  }
  if (fact.found && fact.interval > 0.0)
    text += fmt::format(" ({:.4g} +- {:.2g} {})", *fact.found + 0.0, fact.interval, fact.unit);
  if (!fact.remark.empty()) text += (fact.found ? "; " : "") + fact.remark;
  return text;
}

std::string sensor_text(const Estimate& e) {
  if (!e.interval) return e.name + ": the data do not tell";
  return fmt::format("{} {:.4g} +- {:.2g}{}{}", e.name, e.value, *e.interval, e.unit == "1" ? "" : " ",
                     e.unit == "1" ? "" : e.unit);
}

std::string explanation_text(const Explanation& x) {
  return fmt::format(
      "noise that explains the record: voltages {:.3g} V rms beside {:.4g} V, currents {:.3g} A rms "
      "(measured {:.3g} A); "
      "innovations of the currents {:.2f}, of the angle {:.2f} of what these and the encoder make",
      x.voltage_noise_v, x.voltage_rms_v, x.current_noise_a, x.current_white_a, x.current_error,
      x.angle_error);
}

std::string to_markdown(const Result& r) {
  std::string text = fmt::format("{}, {} samples\n\n", r.method, r.samples);
  text += fmt::format(
      "| parameter | unit | estimate | 95 % | truth | error | inside | by the equations | index (x{}) |\n"
      "|---|---|---|---|---|---|---|---|---|\n",
      r.index_factor);
  for (const Estimate& e : r.parameters) {
    const EstimateText cell = text_of(r, e);
    text +=
        fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", e.name, e.unit, cell.value,
                    cell.interval, cell.truth, cell.error, inside_text(r, e), cell.by_equations, cell.index);
  }
  text += fmt::format("\nError index {:.4g}", r.error_index);
  if (r.mechanical_error_index) text += fmt::format(", mechanical {:.4g}", *r.mechanical_error_index);
  text += fmt::format(", condition {:.3g}. Verdict: {}.\n", r.condition, r.excitation.verdict);
  if (r.explanation) text += "\n" + explanation_text(*r.explanation) + ".\n";
  if (!r.sensors.empty()) text += "\nErrors of the sensors:\n\n";
  for (const Estimate& error : r.sensors)
    text += "* " + sensor_text(error) + "\n";
  if (!r.wiring.empty()) text += "\nWiring:\n\n";
  for (const WiringFact& fact : r.wiring)
    text += "* " + wiring_text(fact) + "\n";
  for (const std::string& note : r.notes)
    text += "\n" + note + "\n";
  return text;
}

std::string to_json(const Result& r) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const Estimate& e : r.parameters) {
    const bool hidden = r.is_unseen(e.name);
    const auto seen = [hidden](double x) { return hidden ? nlohmann::json(nullptr) : number(x); };
    nlohmann::json row = {{"estimate", seen(e.value)},
                          {"unit", e.unit},
                          {"interval", e.interval ? seen(*e.interval) : nlohmann::json(nullptr)},
                          {"by_equations", seen(e.by_equations.value_or(e.value))},
                          {"index", number(e.index)}};
    row["truth"] = e.truth ? number(*e.truth) : nlohmann::json(nullptr);
    const std::optional<bool> inside = is_inside(r, e);
    row["inside"] = inside ? nlohmann::json(*inside) : nlohmann::json(nullptr);
    parameters[e.name] = row;
  }
  nlohmann::json all = {{"kind", r.kind},
                        {"method", r.method},
                        {"parameters", parameters},
                        {"index_factor", r.index_factor},
                        {"error_index", number(r.error_index)},
                        {"condition", number(r.condition)},
                        {"samples", r.samples},
                        {"identifiable", r.excitation.sufficient},
                        {"unseen", r.excitation.unseen},
                        {"verdict", r.excitation.verdict},
                        {"notes", r.notes}};
  if (r.mechanical_error_index) all["mechanical_error_index"] = number(*r.mechanical_error_index);
  if (r.explanation) {
    const Explanation& x = *r.explanation;
    all["explanation"] = {
        {"voltage_noise_v", number(x.voltage_noise_v)}, {"voltage_rms_v", number(x.voltage_rms_v)},
        {"current_noise_a", number(x.current_noise_a)}, {"current_white_a", number(x.current_white_a)},
        {"current_error", number(x.current_error)},     {"angle_error", number(x.angle_error)}};
  }
  for (const Estimate& error : r.sensors)
    all["sensors"][error.name] = {
        {"estimate", error.interval ? number(error.value) : nlohmann::json(nullptr)},
        {"unit", error.unit},
        {"interval", error.interval ? number(*error.interval) : nlohmann::json(nullptr)}};
  for (const double flux_wb : r.curve_wb) {
    const Estimate& current = *r.find(curve_name(flux_wb));
    all["magnetising_curve"].push_back({{"flux_wb", flux_wb},
                                        {"current_a", number(current.value)},
                                        {"interval_a", number(current.interval.value_or(0.0))}});
  }
  if (!r.wiring.empty()) {
    nlohmann::json& wiring = all["wiring"] = nlohmann::json::object();
    for (const WiringFact& fact : r.wiring)
      wiring[fact.name] = {{"found", fact.found ? number(*fact.found) : nlohmann::json(nullptr)},
                           {"unit", fact.unit},
                           {"interval", number(fact.interval)},
                           {"used", number(fact.used)},
                           {"given", fact.given},
                           {"contradicts", fact.contradicts},
                           {"remark", fact.remark}};
  }
  return all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string to_motor_toml(const Result& r, const MotorFile& file) {
  if (!r.excitation.sufficient) throw IdentificationError("no motor file: " + r.excitation.verdict);
  std::string text = fmt::format("name = {}\nsource = {}\n\n[machine]\nkind = {}\n", toml_string(file.name),
                                 toml_string(file.source), toml_string(r.kind));
  if (r.kind != "pm_dc") text += fmt::format("star = {}\npole_pairs = {}\n", file.star, file.pole_pairs);
  for (const Row& row : machine_rows(r))
    text += line_of(row);
  if (is_saturated(r)) text += curve_text(magnetising_curve(r));
  if (r.find("J") == nullptr) return text;
  text += "\n[mechanics]\n" + line_of({"inertia_kgm2", r.at("J"), false});
  // A negative friction is noise around zero.
  if (r.find("f") != nullptr) text += line_of({"viscous_friction_nms", std::max(0.0, r.at("f")), true});
  if (r.find("f_c") != nullptr) {
    const double coulomb = std::max(0.0, r.at("f_c"));
    text += line_of({"coulomb_friction_nm", coulomb, true}) + line_of({"static_friction_nm", coulomb, true});
  }
  return text;
}

}  // namespace drivebench::identification
