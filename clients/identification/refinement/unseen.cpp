#include "clients/identification/refinement/unseen.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

namespace drivebench::identification {
namespace {

/// Half of an interval, of the value. Beyond a tenth a valley of the error may bend, and the interval, which
/// is straight, does not tell how far it goes; friction and load enter linearly.
constexpr double kWidest = 0.1;
constexpr double kWidestFriction = 0.5;
constexpr double kImmaterial = 0.02;  ///< half of a friction's interval, of the torque that accelerates

bool is_split(std::string_view name) {
  return name == "split" || name == "l_s" || name == "l_r";
}

}  // namespace

double accelerating_torque(const Series& speeds, double period_s, double inertia) {
  const std::size_t span = std::max<std::size_t>(1, speeds.size() / 100);
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t k = span; k < speeds.size(); k += span, ++count)
    sum += (speeds[k] - speeds[k - span]) * (speeds[k] - speeds[k - span]);
  return inertia * std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, count))) /
         (static_cast<double>(span) * period_s);
}

std::vector<std::string> unseen_parameters(const Result& result, double torque_nm, double speed_rad_s) {
  std::vector<std::string> unseen;
  const auto immaterial = [&](const Estimate& e) {
    const double factor = e.name == "f" ? speed_rad_s : e.name == "f_c" || e.name == "tau_L" ? 1.0 : HUGE_VAL;
    return *e.interval * factor < kImmaterial * torque_nm;
  };
  for (const Estimate& e : result.parameters) {
    if (e.name == "K17" || e.name == "L_g" || is_split(e.name)) continue;
    const bool linear = e.name == "f" || e.name == "f_c" || e.name == "tau_L";
    const double widest = linear ? kWidestFriction : kWidest;
    if (!(*e.interval < widest * std::abs(e.value)) && !immaterial(e)) unseen.push_back(e.name);
  }
  const auto electrical = [](const Estimate& e) {
    constexpr std::array kMechanical = {"J", "f", "f_c", "tau_L", "K16", "K17"};
    return std::ranges::find(kMechanical, e.name) == kMechanical.end();
  };
  const auto belongs = [&](const Estimate& e) { return electrical(e) && !is_split(e.name); };
  if (std::ranges::any_of(result.parameters, [&](const Estimate& e) {
        return belongs(e) && std::ranges::find(unseen, e.name) != unseen.end();
      })) {
    std::erase_if(unseen, [&](const std::string& name) { return electrical(*result.find(name)); });
    std::vector<std::string> all;
    for (const Estimate& e : result.parameters) {
      if (electrical(e)) all.push_back(e.name);
    }
    unseen.insert(unseen.begin(), all.begin(), all.end());
  }
  const auto is_unseen = [&](const char* name) { return std::ranges::find(unseen, name) != unseen.end(); };
  if (result.find("K17") != nullptr && (is_unseen("f") || is_unseen("tau_L") || is_unseen("J")))
    unseen.emplace_back("K17");
  return unseen;
}

std::vector<std::string> unseen_split(const Result& result) {
  const Estimate* const stator = result.find("l_s");
  if (stator == nullptr) return {};
  const auto wide = [&](const char* name) {
    const Estimate& e = *result.find(name);
    return !(*e.interval < kWidest * e.value);
  };
  if (wide("l_s") || wide("l_r")) return {"split", "l_s", "l_r"};
  return {};
}

}  // namespace drivebench::identification
