#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "clients/command/common/commands.hpp"

namespace drivebench::command {

/// Adds `identify` to the command line. `choose` is called when it was named and `options` hold what was
/// said.
void add_identify_command(CLI::App& app, LinkChoice& link, bool& json, IdentifyOptions& options,
                          const std::function<void()>& choose);

}  // namespace drivebench::command
