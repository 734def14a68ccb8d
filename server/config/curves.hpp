#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "protocols/document.hpp"
#include "server/config/strict_table.hpp"

namespace drivebench {

/// The curve if the table has it and it is right: points [[x, y], ...], or the name of a CSV file relative to
/// `folder` (empty: no other file may be named).
std::optional<Curve> read_curve(StrictTable& table, const CurveParameter& row,
                                const std::filesystem::path& folder, ProblemList& problems);

/// Points from text with x and y in two columns, separated by a comma, and perhaps a line with their names at
/// the top. Tells the first line that is wrong. `rising`: y must rise as well as x.
std::optional<std::vector<CurvePoint>> parse_curve_csv(std::string_view text, const std::string& file,
                                                       bool rising, ProblemList& problems);

/// The points as a TOML value that read_curve() reads back bit for bit.
std::string curve_text(const Curve& curve);

inline constexpr std::size_t kMaxCurveFileBytes = 8'388'608;

}  // namespace drivebench
