#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/convert/convert.hpp"
#include "clients/control/math/frames.hpp"
#include "clients/models/two_phase.hpp"
#include "protocols/json.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

/// Power-invariant components have √(3/2) of the amplitude of three phases.
constexpr double kPowerOverAmplitude = std::numbers::sqrt3 / std::numbers::sqrt2;

/// The two-phase equivalent, power-invariant, in the stator's frame.
PhasePair two_phases(const ConvertFrameOptions& o) {
  const int given = (o.abc.empty() ? 0 : 1) + (o.alpha_beta.empty() ? 0 : 1) + (o.dq.empty() ? 0 : 1);
  if (given != 1) throw UsageError("give one of --abc, --alpha-beta and --dq");
  if (!o.abc.empty()) return two_phase_of(o.abc[0], o.abc[1], o.abc[2]);
  const double scale = o.amplitude ? kPowerOverAmplitude : 1.0;
  if (!o.alpha_beta.empty()) return {.a = scale * o.alpha_beta[0], .b = scale * o.alpha_beta[1]};
  return control::Direction::at(o.angle_deg * std::numbers::pi / 180.0)
      .to_ab({.d = scale * o.dq[0], .q = scale * o.dq[1]});
}

}  // namespace

int run_convert_frame(const ConvertFrameOptions& options) {
  const PhasePair x = two_phases(options);
  const control::DirectQuadrature dq =
      control::Direction::at(options.angle_deg * std::numbers::pi / 180.0).to_dq(x);
  const std::array<double, 3> phases = three_phases_of(x);
  const double zero = options.abc.empty() ? 0.0 : (options.abc[0] + options.abc[1] + options.abc[2]) / 3.0;
  const double amplitude = 1.0 / kPowerOverAmplitude;
  if (options.json) {
    const auto both = [&](double scale) {
      return Json{{"alpha", scale * x.a}, {"beta", scale * x.b}, {"d", scale * dq.d}, {"q", scale * dq.q}};
    };
    const Json out = {{"abc", {phases[0] + zero, phases[1] + zero, phases[2] + zero}},
                      {"zero", zero},
                      {"angle_deg", options.angle_deg},
                      {"power_invariant", both(1.0)},
                      {"amplitude_invariant", both(amplitude)}};
    fmt::print("{}\n", json_text(out));
    return kExitOk;
  }
  // What the rounding of the others leaves of a zero is one.
  const double largest = std::max(std::hypot(x.a, x.b), std::abs(zero));
  const auto text = [largest](double value) {
    return number_text(std::abs(value) < 1e-12 * largest ? 0.0 : value);
  };
  fmt::print("phases a, b, c          {:>12}{:>12}{:>12}   (zero sequence {})\n", text(phases[0] + zero),
             text(phases[1] + zero), text(phases[2] + zero), text(zero));
  const auto row = [&](const char* name, double scale) {
    fmt::print("{:<24}{:>12}{:>12}{:>12}{:>12}\n", name, text(scale * x.a), text(scale * x.b),
               text(scale * dq.d), text(scale * dq.q));
  };
  fmt::print("\n{:<24}{:>12}{:>12}{:>12}{:>12}   d axis at {:g} degrees\n", "", "alpha", "beta", "d", "q",
             options.angle_deg);
  row("power-invariant", 1.0);
  row("amplitude-invariant", amplitude);
  return kExitOk;
}

}  // namespace drivebench::command
