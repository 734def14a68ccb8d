#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/gains/move_allowance.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/run.hpp"
#include "clients/control/math/limits.hpp"
#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// The requirements of a preset on its axis. The sample rate is that of the run.
struct Requirements {
  std::string_view machine_kind;           ///< as bench files and descriptions have it, like "induction"
  double counts_per_revolution;            ///< 0: the encoder does not matter
  double pole_pairs;                       ///< 0: the machine has none
  double voltage_limit_v;                  ///< the bench's must not be lower
  Quantity quantity = Quantity::kVoltage;  ///< kCurrent needs a current amplifier
  /// A second kind that it fits, if any: the same equations under another name.
  std::string_view other_kind{};
  /// The signal that the controller measures beside counts and phase currents, which not every link carries:
  /// "i_f_a", "hall_lines", "tachometer_v", "edge_age_s"; empty: nothing.
  std::string_view signal{};
  bool drives_second = false;  ///< a second axis must share the amplifier
};

/// A controller and a run that belong together, with the source of their numbers.
struct Preset {
  std::string_view name;  ///< "book/8.2.2"
  std::string_view source;
  std::string_view expectation;  ///< the result that a run of it must show
  std::string_view bench;        ///< configs/benches/<bench>.toml, where it runs as it stands
  Requirements needs;
  std::function<std::vector<Gain>()> gains;
  /// A run with some gains overridden; throws std::invalid_argument (gain, value, rule; or which limit the
  /// move exceeds and when).
  std::function<Run(std::span<const Gain> overrides)> make;
};

/// The words of a preset, as above.
struct PresetText {
  std::string_view name;
  std::string_view source;
  std::string_view expectation;
  std::string_view bench;
};

/// A preset is data: its parts, parameter structs with gain tables, and the function that makes a run of
/// them.
template <class... Parts>
Preset preset_of(const PresetText& text, const Requirements& needs, Run (*run)(const Parts&...),
                 const std::type_identity_t<Parts>&... parts) {
  return {.name = text.name,
          .source = text.source,
          .expectation = text.expectation,
          .bench = text.bench,
          .needs = needs,
          .gains = [parts...] { return gains_of(parts...); },
          .make =
              [run, parts...](std::span<const Gain> overrides) {
                return std::apply(run, with_gains(std::tuple{parts...}, overrides));
              }};
}

/// The base with some members changed, so that a preset that differs by a gain is one row:
///   with(kServo, &BldcParameters::voltage_limit_v, 200.0, &BldcParameters::drive, Quantity::kVoltage)
template <class P>
constexpr P with(P p) noexcept {
  return p;
}
template <class P, class Member, class... More>
constexpr P with(P p, Member P::*member, const std::type_identity_t<Member>& value,
                 const More&... more) noexcept {
  p.*member = value;
  return with(p, more...);
}

/// A run at the rate of its controller.
inline Run run_at(double sample_rate_hz, std::unique_ptr<Controller> controller,
                  std::shared_ptr<const Trajectory> move, const RunTiming& timing) {
  return {std::move(controller), std::move(move), with(timing, &RunTiming::sample_rate_hz, sample_rate_hz)};
}

/// A cubic move under a controller of p, refused where `demands` exceed the allowance.
template <class ControllerType, class P, class Demands>
Run cubic_run(const P& p, const TrajectoryParameters& path, const MoveAllowance& allowed,
              const RunTiming& timing, const Demands& demands) {
  refuse(first_exceeded(path.duration_s(), p.period_s(),
                        [&](double t_s) { return demands(p, allowed, trajectory_at(path, t_s)); }));
  return run_at(p.sample_rate_hz, std::make_unique<ControllerType>(p), std::make_shared<CubicMove>(path),
                timing);
}

}  // namespace drivebench::control
