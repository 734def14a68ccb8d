#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/run.hpp"

namespace drivebench::control {

/// What an axis must be for a preset to fit. The sample rate is that of the run.
struct Requirements {
  std::string_view machine_kind;           ///< as bench files and descriptions have it, like "induction"
  double counts_per_revolution;            ///< 0: the encoder does not matter
  double pole_pairs;                       ///< 0: the machine has none
  double voltage_limit_v;                  ///< the bench's must not be lower
  Quantity quantity = Quantity::kVoltage;  ///< kCurrent needs a current amplifier
  /// A second kind that it fits, if any: the same equations under another name.
  std::string_view other_kind{};
  /// What it measures beside counts and the currents of the phases, which not every link carries: "i_f_a",
  /// "hall_lines", "tachometer_v", "edge_age_s"; empty: nothing.
  std::string_view signal{};
};

/// A controller and a run that belong together, with where their numbers come from.
struct Preset {
  std::string_view name;  ///< "book/8.2.2"
  std::string_view source;
  std::string_view expectation;  ///< what a run of it must show
  std::string_view bench;        ///< configs/benches/<bench>.toml, where it runs as it stands
  Requirements needs;
  std::vector<Gain> (*gains)();
  /// A run with some gains overridden; throws std::invalid_argument (gain, value, rule; or which limit the
  /// move exceeds and when).
  Run (*make)(std::span<const Gain> overrides);
};

}  // namespace drivebench::control
