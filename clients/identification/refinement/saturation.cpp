#include "clients/identification/refinement/saturation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>

#include "clients/identification/data/magnetising_curve.hpp"
#include "plant/math/trig.hpp"

namespace drivebench::identification {
namespace {

constexpr int kPoints = 5;

double three_digits(double x) {
  return std::strtod(fmt::format("{:.3g}", x).c_str(), nullptr);
}

Estimate unmeasured(std::string name, std::string unit, double value) {
  return {.name = std::move(name),
          .unit = std::move(unit),
          .value = value,
          .index = std::nan(""),
          .truth = {},
          .by_equations = std::nan("")};
}

}  // namespace

Result saturated_start(const Result& straight, double largest_wb, const Result* near) {
  Result start = straight;
  start.sensors.clear();
  start.kind = "saturated_induction";
  start.method = "induction motor with a magnetising curve, begun from a straight one";
  start.explanation.reset();
  std::erase_if(start.parameters, [](const Estimate& e) {
    return e.name.starts_with('K') || e.name == "M" || e.name == "L_R" || e.name == "R_R";
  });
  for (int k = 1; k <= kPoints; ++k) {
    const double flux_wb = three_digits(largest_wb * sine(0.5 * std::numbers::pi * k / kPoints));
    start.curve_wb.push_back(flux_wb);
    const double current_a =
        near != nullptr ? magnetising_curve(*near).current_a(flux_wb) : flux_wb / straight.at("M");
    start.parameters.push_back(unmeasured(curve_name(flux_wb), "A", current_a));
  }
  start.parameters.push_back(unmeasured("split", "1", 0.0));
  for (const auto& [name, unit] : {std::pair{"R_R", "ohm"}, {"l_s", "H"}, {"l_r", "H"}})
    start.parameters.push_back(unmeasured(name, unit, 0.0));
  return start;
}

bool is_motor(const Result& result) {
  const Estimate* const sigma = result.find("sigma");
  if (sigma != nullptr && !(sigma->value < 1.0)) return false;
  if (!is_saturated(result)) return true;
  return std::abs(result.at("split")) < 1.0;
}

std::string reason_against_curve(const Result& result, double white_v) {
  constexpr double kMostNoise = 3.0;
  constexpr double kMostOfVoltage = 0.002;
  const MagnetisingCurve curve = magnetising_curve(result);
  const double largest_wb = curve.largest_wb();
  if (!curve.rises()) return "its magnetising current falls where the flux grows";
  if (curve.at(largest_wb * largest_wb).chord < curve.at(0.0).chord)
    return "its iron needs less current per flux where the flux is large";
  const Explanation& found = *result.explanation;
  if (found.voltage_noise_v > kMostNoise * white_v + kMostOfVoltage * found.voltage_rms_v)
    return fmt::format(
        "with a magnetising curve it needs {:.3g} V rms beside the measured voltages, which have {:.3g} V of "
        "noise",
        found.voltage_noise_v, white_v);
  return {};
}

std::string curve_note(const Result& result) {
  return fmt::format(
      "T_R, L_S and sigma are those without flux; i_m is the magnetising current at a flux, up to {:.3g} "
      "Wb{}",
      result.curve_wb.back(),
      result.is_unseen("l_s")
          ? "; the record does not tell how the leakage divides between stator and rotor, and the "
            "motor file has the likeliest split"
          : "");
}

}  // namespace drivebench::identification
