#pragma once

#include <optional>
#include <span>
#include <string>

#include "clients/command/control/control.hpp"
#include "clients/control/presets/presets.hpp"

/// Presets as the command line names them.
namespace drivebench::command {

/// Throws UsageError with the nearest name there is.
const control::Preset& chosen_preset(const std::string& name);

/// The run of a preset; UsageError if a gain cannot be or the move exceeds a limit.
control::Run made(const control::Preset& preset, std::span<const control::Gain> overrides);

/// With its own gains; nothing for a preset that is there to be refused.
std::optional<control::Run> made_as_it_stands(const control::Preset& preset);

/// The gains of a preset with the overrides in their place.
std::vector<control::Gain> gains_with(const control::Preset& preset,
                                      std::span<const control::Gain> overrides);

/// Prints the presets (--list), and with --gains the gains of all or of the one chosen.
int run_list(const ControlOptions& options);

}  // namespace drivebench::command
