#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "clients/regression/suite/case.hpp"

namespace drivebench::regression {

/// The tables of a bench file that belong to a place: a composed bench has none of them.
inline constexpr auto kTablesOfAPlace =
    std::to_array<std::string_view>({"can", "modbus", "tls", "audit", "experiments", "tcp"});

/// The bench of a case as one text that anybody can serve: the bench file with its motor files, the overrides
/// of the case, its seed, mode and steps, and without what belongs to a place (buses, TLS, folders), except a
/// bus that the device under test asks for. CSV
/// files of curves are named by their absolute paths. Throws ConfigError with all problems.
std::string composed_bench(const Case& c, const std::filesystem::path& bench_file);

}  // namespace drivebench::regression
