#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/control/gains/gains.hpp"

namespace drivebench::command {

/// A run of a recording as an SVG picture.
struct PlotOptions {
  std::string recording{};
  std::string out_file{};  ///< empty: standard output
  std::string preset{};    ///< draws its trajectory too; empty: none
  std::vector<control::Gain> overrides{};
  std::string axis{};  ///< name; empty: the first in the file
  std::optional<std::uint64_t>
      from_tick{};                     ///< start of the run; default: the first command with a set-point
  std::vector<std::string> panels{};   ///< empty: speed, currents and voltages
  std::vector<std::string> signals{};  ///< in the place of panels: a panel for each unit
  std::string title{};                 ///< empty: the preset, or else the file
};
int run_plot(const PlotOptions& options);

}  // namespace drivebench::command
