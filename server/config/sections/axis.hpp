#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include "server/config/config.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// One [[axis]] of a bench file, with its motor file.
struct AxisReading {
  AxisConfig config;
  AxisSetup setup;
  bool parameters_valid = false;  ///< setup.parameters are complete and without problems
};

/// Reads the axis that follows `before`. Its default node id is its number, from 1 on. `names` are those of
/// all axes. `odd` collects valid but implausible values.
AxisReading read_axis(StrictTable& axis, const std::filesystem::path& folder, std::int64_t period_ns,
                      std::span<const std::string> names, std::span<const AxisReading> before,
                      ProblemList& problems, std::vector<ConfigProblem>& odd);

/// Reads a duration in seconds, rounded to the nearest tick, or in ticks; both together are a problem.
std::optional<Tick> read_ticks(StrictTable& table, std::string_view seconds_key, std::string_view ticks_key,
                               std::int64_t period_ns);

}  // namespace drivebench
