#include <fmt/core.h>

#include <array>
#include <numbers>
#include <string>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/convert/convert.hpp"
#include "clients/models/winding_factors.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

constexpr std::array kHarmonics = {1, 3, 5, 7, 9, 11, 13};
constexpr double kPi = std::numbers::pi;

/// Loops of one pole of a phase, and the span of their coils as a part of a pole.
struct Winding {
  std::vector<double> angles_rad;
  double pitch = 1.0;
};

Winding winding_of(const ConvertWindingOptions& o) {
  if ((o.slots > 0) == !o.angles_deg.empty()) throw UsageError("give --slots or --angles-deg");
  Winding winding;
  if (!o.angles_deg.empty()) {
    if (o.pitch_slots) throw UsageError("--pitch counts slots and needs --slots");
    for (const double angle : o.angles_deg)
      winding.angles_rad.push_back(angle * kPi / 180.0);
    return winding;
  }
  if (o.poles % 2 != 0) throw UsageError(fmt::format("--poles is {} but must be even", o.poles));
  if (o.slots % (o.poles * o.phases) != 0) {
    throw UsageError(fmt::format(
        "--slots is {} but must be a multiple of {}: as many for each phase under each of {} poles", o.slots,
        o.poles * o.phases, o.poles));
  }
  const int slots_of_pole = o.slots / o.poles;
  const int pitch = o.pitch_slots.value_or(slots_of_pole);
  if (pitch >= 2 * slots_of_pole)
    throw UsageError(
        fmt::format("--pitch is {} but must be below two poles, {} slots", pitch, 2 * slots_of_pole));
  winding.pitch = static_cast<double>(pitch) / slots_of_pole;
  for (int k = 0; k < slots_of_pole / o.phases; ++k)
    winding.angles_rad.push_back(k * kPi / slots_of_pole);
  return winding;
}

struct Factors {
  int harmonic;
  double distribution;
  double pitch;
};

std::vector<Factors> factors_of(const Winding& winding) {
  std::vector<Factors> all;
  all.reserve(kHarmonics.size());
  for (const int harmonic : kHarmonics)
    all.push_back({.harmonic = harmonic,
                   .distribution = distribution_factor(winding.angles_rad, harmonic),
                   .pitch = pitch_factor(winding.pitch, harmonic)});
  return all;
}

}  // namespace

int run_convert_winding(const ConvertWindingOptions& options) {
  const std::vector<Factors> factors = factors_of(winding_of(options));
  if (options.json) {
    Json out = Json::array();
    for (const Factors& f : factors) {
      out.push_back({{"harmonic", f.harmonic},
                     {"distribution", f.distribution},
                     {"pitch", f.pitch},
                     {"winding", f.distribution * f.pitch},
                     {"even", even_distribution_factor(options.phases, f.harmonic)}});
    }
    fmt::print("{}\n", json_text(out));
    return kExitOk;
  }
  fmt::print("{:>8}{:>14}{:>10}{:>10}{:>26}\n", "harmonic", "distribution", "pitch", "winding",
             fmt::format("evenly spread, {} phase{}", options.phases, options.phases == 1 ? "" : "s"));
  for (const Factors& f : factors) {
    fmt::print("{:>8}{:>14.4f}{:>10.4f}{:>10.4f}{:>26.4f}\n", f.harmonic, f.distribution, f.pitch,
               f.distribution * f.pitch, even_distribution_factor(options.phases, f.harmonic));
  }
  return kExitOk;
}

}  // namespace drivebench::command
