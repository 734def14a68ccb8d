#include "clients/identification/refinement/verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace drivebench::identification {
namespace {

/// What shows a parameter.
struct Advice {
  MotorKind kind;
  std::string_view names;  ///< each between blanks
  std::string_view experiment;
};

constexpr auto kAdvice = std::to_array<Advice>({
    {MotorKind::kInduction, " R_S T_R L_S sigma M L_R R_R K4 K6 K8 K14 ",
     "record a start from the line until 50 ms after the motor has run up, or a motor that changes its load"},
    {MotorKind::kDc, " R K_T ",
     "let current and speed change independently, by a voltage that changes its sign several times a second"},
    {MotorKind::kPmSynchronous, " R_S K_m ",
     "let current and speed change independently, by a u_q that swings several times a second"},
    {MotorKind::kBldc, " R_S tau_p ",
     "let current and speed change independently, by a voltage that swings several times a second"},
    {MotorKind::kDc, " L ", "let the current change within L/R, by steps of the voltage"},
    {MotorKind::kPmSynchronous, " L_S L_d L_q L_g ",
     "let the current change within L/R, by a u_d that swings at some 60 Hz"},
    {MotorKind::kBldc, " L+M ",
     "let the current change within L/R, by a higher speed or steps of the voltage"},
});

constexpr std::string_view kInertia = "let the speed rise and fall by much of itself";
constexpr std::string_view kFriction = "record longer, at low and high speed, and in both directions";
constexpr std::string_view kLoad = "record longer after the motor has run up";
constexpr std::string_view kLessFlux =
    "record a start at lower flux: at the same frequency with half the voltage or less";

std::string_view experiment_for(MotorKind kind, const std::string& name) {
  if (name == "J" || name == "K16") return kInertia;
  if (name == "f" || name == "f_c") return kFriction;
  if (name == "tau_L" || name == "K17") return kLoad;
  for (const Advice& each : kAdvice) {
    if (each.kind == kind && each.names.find(" " + name + " ") != std::string_view::npos)
      return each.experiment;
  }
  return kFriction;
}

/// The experiments that would show these parameters, each once.
std::string experiments_for(MotorKind kind, const std::vector<std::string>& names) {
  std::vector<std::string_view> experiments;
  for (const std::string& name : names) {
    const std::string_view experiment = experiment_for(kind, name);
    if (std::ranges::find(experiments, experiment) == experiments.end()) experiments.push_back(experiment);
  }
  return fmt::format("{}", fmt::join(experiments, "; "));
}

std::vector<std::string> names_of(const Result& result) {
  std::vector<std::string> names;
  for (const Estimate& estimate : result.parameters)
    names.push_back(estimate.name);
  return names;
}

}  // namespace

std::string unexplained(const Explanation& found, double largest_current_a) {
  constexpr double kMostCurrent = 3.0;
  constexpr double kMostOfLargest = 0.01;
  constexpr double kMostVoltage = 0.03;
  constexpr double kMostError = 1.5;
  std::string reason;
  const auto add = [&reason](const std::string& text) { reason += (reason.empty() ? "" : ", ") + text; };
  if (found.current_noise_a > kMostCurrent * found.current_white_a + kMostOfLargest * largest_current_a)
    add(fmt::format("its currents are off by {:.3g} A rms where the measured ones have {:.3g} A of noise",
                    found.current_noise_a, found.current_white_a));
  if (found.current_error > kMostError)
    add(fmt::format("its currents stray {:.3g} times as far as these noises allow", found.current_error));
  if (found.voltage_noise_v > kMostVoltage * found.voltage_rms_v)
    add(fmt::format("it needs {:.3g} V rms beside the measured {:.3g} V", found.voltage_noise_v,
                    found.voltage_rms_v));
  if (found.angle_error > kMostError)
    add(fmt::format("its shaft strays {:.3g} times as far as the counts of the encoder allow",
                    found.angle_error));
  return reason;
}

Excitation verdict_on(MotorKind kind, std::vector<std::string> unseen) {
  if (unseen.empty()) return {.sufficient = true, .unseen = {}, .verdict = "the data see every parameter"};
  const std::string sentence =
      fmt::format("not identifiable: under the noise of these data {} may lie far off; {}",
                  fmt::join(unseen, ", "), experiments_for(kind, unseen));
  return {.sufficient = false, .unseen = std::move(unseen), .verdict = sentence};
}

Excitation verdict_without_start(MotorKind kind, const Result& result) {
  Excitation e{.sufficient = false, .unseen = names_of(result), .verdict = {}};
  const std::string& by_equations = result.excitation.verdict;
  e.verdict = fmt::format("{}; {}", result.excitation.sufficient ? "not identifiable" : by_equations,
                          experiments_for(kind, e.unseen));
  return e;
}

Excitation verdict_against(const Result& result, const std::string& reason) {
  Excitation e{.sufficient = false, .unseen = names_of(result), .verdict = {}};
  e.verdict = "no motor of this kind explains the record: " + reason +
              "; check pole pairs, counts and direction of the encoder, order of the phases and voltage "
              "shift, or record "
              "a run that shows more of the motor";
  if (result.kind == "induction") e.verdict += fmt::format("; if its iron may saturate, {}", kLessFlux);
  return e;
}

Excitation verdict_on_suspicion(const Result& result, const Suspicion& suspicion) {
  Excitation e{.sufficient = false, .unseen = names_of(result), .verdict = {}};
  e.verdict = fmt::format(
      "no motor of this kind explains the record as it stands: {} would explain it better, by {:.3g} "
      "standard "
      "deviations where noise alone passes {:.2g} once in 1,000 records, and move {} by {:.3g} of its 95 % "
      "intervals; {}",
      suspicion.what, suspicion.deviations, suspicion.tells, suspicion.moved, suspicion.shift,
      suspicion.remedy);
  return e;
}

Excitation verdict_on_open_curve(const Result& saturated) {
  Excitation e{.sufficient = false, .unseen = names_of(saturated), .verdict = {}};
  e.verdict = fmt::format(
      "the motor saturates at the flux of this record, and the record leaves its magnetising curve open: {} "
      "may lie "
      "far off; record a start from rest until 50 ms after the motor has run up, which goes through all "
      "fluxes; or "
      "{}",
      fmt::join(saturated.excitation.unseen, ", "), kLessFlux);
  return e;
}

Excitation verdict_on_saturation(const Result& result, const BendTest& bend) {
  Excitation e{.sufficient = false, .unseen = names_of(result), .verdict = {}};
  e.verdict = fmt::format(
      "the motor saturates at the flux of this record, so that no single L_S and T_R describes it: that its "
      "magnetising curve bends is {:.3g} in chi-squared, where noise alone passes {:.3g} once in 1,000 "
      "records; {}, "
      "and check the voltage shift, as voltages of another instant look alike",
      bend.evidence, kTellsBend, kLessFlux);
  return e;
}

}  // namespace drivebench::identification
