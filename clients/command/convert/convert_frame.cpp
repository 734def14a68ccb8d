#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/convert/convert.hpp"
#include "plant/math/frames.hpp"
#include "plant/math/length.hpp"
#include "plant/math/unbounded.hpp"
#include "protocols/json.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

/// Power-invariant components have √(3/2) of the amplitude of three phases.
constexpr double kPowerOverAmplitude = std::numbers::sqrt3 / std::numbers::sqrt2;

/// The two-phase equivalent, power-invariant, in the stator's frame.
TwoPhase two_phases(const ConvertFrameOptions& o) {
  const int given = (o.abc.empty() ? 0 : 1) + (o.alpha_beta.empty() ? 0 : 1) + (o.dq.empty() ? 0 : 1);
  if (given != 1) throw UsageError("give one of --abc, --alpha-beta and --dq");
  if (!o.abc.empty()) return three_to_two({.a = o.abc[0], .b = o.abc[1], .c = o.abc[2]});
  const double scale = o.amplitude ? kPowerOverAmplitude : 1.0;
  if (!o.alpha_beta.empty()) return {.a = scale * o.alpha_beta[0], .b = scale * o.alpha_beta[1]};
  return to_ab({.d = scale * o.dq[0], .q = scale * o.dq[1]},
               cos_sin_unbounded(o.angle_deg * std::numbers::pi / 180.0));
}

}  // namespace

int run_convert_frame(const ConvertFrameOptions& options) {
  const TwoPhase x = two_phases(options);
  const Dq dq = to_dq(x, cos_sin_unbounded(options.angle_deg * std::numbers::pi / 180.0));
  const ThreePhase phases = two_to_three(x);
  const double zero = options.abc.empty() ? 0.0 : (options.abc[0] + options.abc[1] + options.abc[2]) / 3.0;
  const double amplitude = 1.0 / kPowerOverAmplitude;
  if (options.json) {
    const auto both = [&](double scale) {
      return Json{{"alpha", scale * x.a}, {"beta", scale * x.b}, {"d", scale * dq.d}, {"q", scale * dq.q}};
    };
    const Json out = {{"abc", {phases.a + zero, phases.b + zero, phases.c + zero}},
                      {"zero", zero},
                      {"angle_deg", options.angle_deg},
                      {"power_invariant", both(1.0)},
                      {"amplitude_invariant", both(amplitude)}};
    fmt::print("{}\n", json_text(out));
    return kExitOk;
  }
  // What the rounding of the others leaves of a zero is one.
  const double largest = std::max(length(x.a, x.b), std::abs(zero));
  const auto text = [largest](double value) {
    return number_text(std::abs(value) < 1e-12 * largest ? 0.0 : value);
  };
  fmt::print("phases a, b, c          {:>12}{:>12}{:>12}   (zero sequence {})\n", text(phases.a + zero),
             text(phases.b + zero), text(phases.c + zero), text(zero));
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
