#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// A test at the terminals whose steady state is read as meters would (motors/classical_tests.hpp),
/// in the place of an identification from samples.
enum class TerminalTest : std::uint8_t { kNone, kDcResistance, kNoLoad, kBlockedRotor, kAll };

/// An experiment that identifies a motor of the book, with the settings of its identification.
struct NamedExperiment {
  std::string_view motor;  ///< of kMotorNames
  std::string_view name;
  std::string_view file;   ///< in configs/experiments, without .toml
  std::string_view bench;  ///< in configs/benches
  std::string_view summary;
  LoadModel load = LoadModel::kViscous;
  double from_s = 0.0;  ///< start of the part of the record for the equations
  double to_s = 0.0;
  double current_hz = 0.0;  ///< corners of the filters; 0: the usual ones
  double voltage_hz = 0.0;
  double shaft_hz = 0.0;
  TerminalTest test = TerminalTest::kNone;  ///< kAll: the three others in turn, `file` is that of the first
};

std::span<const NamedExperiment> named_experiments() noexcept;

/// The experiment of this motor with this name, or null.
const NamedExperiment* find_experiment(std::string_view motor, std::string_view name) noexcept;

/// The first experiment of a motor, or null.
const NamedExperiment* first_experiment(std::string_view motor) noexcept;

/// The experiment of this test.
const NamedExperiment& experiment_of(TerminalTest test) noexcept;

/// The names of a motor's experiments, separated by commas.
std::string experiment_names(std::string_view motor);

/// Sets load model, window and filters from a named experiment.
void apply(const NamedExperiment& named, Settings& settings) noexcept;

}  // namespace drivebench::identification
