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

/// Reads a curve: points [[x, y], ...], or the name of a CSV file relative to `folder` (empty: the table must
/// not name a file). Nothing if the curve is absent or wrong.
std::optional<Curve> read_curve(StrictTable& table, const CurveParameter& row,
                                const std::filesystem::path& folder, ProblemList& problems);

/// Reads points from CSV text with columns x and y and an optional headline. Reports the first wrong line.
/// `rising`: y must rise like x.
std::optional<std::vector<CurvePoint>> parse_curve_csv(std::string_view text, const std::string& file,
                                                       bool rising, ProblemList& problems);

/// The points as a TOML value that read_curve() reads back equal, bit for bit.
std::string curve_text(const Curve& curve);

inline constexpr std::size_t kMaxCurveFileBytes = 8'388'608;

}  // namespace drivebench
