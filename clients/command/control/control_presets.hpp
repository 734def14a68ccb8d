#pragma once

#include <span>
#include <string>

#include "clients/command/control/control.hpp"
#include "clients/control/presets/presets.hpp"
#include "clients/reference/preset_fit.hpp"

/// Finds and builds presets by their names on the command line.
namespace drivebench::command {

/// The preset with this name; otherwise throws UsageError with the nearest name.
const control::Preset& chosen_preset(const std::string& name);

/// The run of a preset. Throws UsageError if a gain is impossible or the move exceeds a limit.
control::Run made(const control::Preset& preset, std::span<const control::Gain> overrides);

using reference::made_as_it_stands;

/// The gains of a preset, overridden.
std::vector<control::Gain> gains_with(const control::Preset& preset,
                                      std::span<const control::Gain> overrides);

/// Prints the presets (--list), and with --gains the gains of all or of the one chosen.
int run_list(const ControlOptions& options);

}  // namespace drivebench::command
