#include "clients/identification/refinement/unknowns.hpp"

#include <cmath>
#include <utility>

#include "clients/identification/data/magnetising_curve.hpp"
#include "plant/math/exponential.hpp"
#include "plant/math/trig.hpp"

namespace drivebench::identification {
namespace {

std::vector<std::string> positive_names(MotorKind kind, bool salient) {
  switch (kind) {
    case MotorKind::kDc:
      return {"R", "L", "K_T", "J"};
    case MotorKind::kInduction:
      return {"R_S", "T_R", "L_S", "sigma", "J"};
    case MotorKind::kPmSynchronous:
      if (salient) return {"R_S", "L_d", "L_q", "K_m", "J"};
      return {"R_S", "L_S", "K_m", "J"};
    case MotorKind::kBldc:
      break;
  }
  return {"R_S", "L+M", "tau_p", "J"};
}

}  // namespace

std::vector<Unknown> unknowns_of(const Settings& e, const Result& start, double speed_rad_s,
                                 double duration_s) {
  std::vector<Unknown> unknowns;
  for (std::string& name : positive_names(e.kind, is_salient(start)))
    unknowns.push_back({.name = std::move(name)});
  for (const double flux_wb : start.curve_wb)
    unknowns.push_back({.name = curve_name(flux_wb)});
  if (is_saturated(start)) unknowns.push_back({.name = "split", .scale = kSplit});
  const double friction = start.at("J") / duration_s;
  for (const char* name : {"f", "f_c", "tau_L"}) {
    if (start.find(name) == nullptr) continue;
    unknowns.push_back(
        {.name = name, .scale = std::string_view(name) == "f" ? friction : friction * speed_rad_s});
  }
  return unknowns;
}

Eigen::VectorXd coordinates_of(const std::vector<Unknown>& unknowns, const Result& result) {
  Eigen::VectorXd z(static_cast<Eigen::Index>(unknowns.size()));
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const double value = result.at(unknowns[k].name);
    z(static_cast<Eigen::Index>(k)) = unknowns[k].scale > 0.0 ? value / unknowns[k].scale : logarithm(value);
  }
  return z;
}

void put(const std::vector<Unknown>& unknowns, const Eigen::VectorXd& at, Result& result) {
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const double z = at(static_cast<Eigen::Index>(k));
    result.find(unknowns[k].name)->value = unknowns[k].scale > 0.0 ? z * unknowns[k].scale : exponential(z);
  }
}

void put_dependent(const Settings& e, Result& result) {
  if (Estimate* const saliency = result.find("L_g"))
    saliency->value = 0.5 * (result.at("L_d") - result.at("L_q"));
  if (e.kind != MotorKind::kInduction) return;
  if (is_saturated(result)) {
    const SaturatedCircuit c = saturated_circuit(result);
    result.find("R_R")->value = c.rotor_resistance_ohm;
    result.find("l_s")->value = c.stator_leakage_h;
    result.find("l_r")->value = c.rotor_leakage_h;
    return;
  }
  const double l_s = result.at("L_S");
  const double t_r = result.at("T_R");
  const double sigma = result.at("sigma");
  const double k14 = 1.0 / (sigma * l_s * t_r);
  const double k4 = (1.0 - sigma) / (sigma * t_r * t_r);
  const bool viscous = result.find("f") != nullptr;
  const std::pair<const char*, double> dependent[] = {
      {"M", l_s * std::sqrt(1.0 - sigma)},
      {"L_R", l_s},
      {"R_R", l_s / t_r},
      {"K4", k4},
      {"K6", k4 + result.at("R_S") * k14},
      {"K8", t_r},
      {"K14", k14},
      {"K16", e.pole_pairs / result.at("J")},
      {"K17", result.at(viscous ? "f" : "tau_L") / result.at("J")}};
  for (const auto& [name, value] : dependent) {
    if (Estimate* const estimate = result.find(name)) estimate->value = value;
  }
}

}  // namespace drivebench::identification
