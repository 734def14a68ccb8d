#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "clients/regression/suite/case.hpp"

namespace drivebench::regression {

/// The tables of a bench file that belong to a place: those of a composed bench are from its case.
inline constexpr auto kTablesOfAPlace =
    std::to_array<std::string_view>({"can", "modbus", "tls", "audit", "experiments", "tcp"});

/// The bench of a case as one text that anybody can serve: the bench file with its motor files, the overrides
/// of the case, its seed, mode and steps, and without what belongs to a place (buses, TLS, folders), except a
/// bus that the device under test asks for. CSV
/// files of curves are named by their absolute paths. Throws ConfigError with all problems.
std::string composed_bench(const Case& c, const std::filesystem::path& bench_file);

/// A composed bench of which remove_places() has taken the bus of its case, with that bus.
std::string linked_bench(const Case& c, const std::filesystem::path& composed);

/// The list of an axis in a bench file to which steps of this action go as events.
std::string_view event_table(Step::Action action) noexcept;

/// A message to the device under test for `drivebench-server --messages`, and its line in the case file.
struct ComposedMessage {
  int line;
  std::string text;  ///< a [[message]] table
};

/// The steps of a case that are messages, on its composed bench.
std::vector<ComposedMessage> composed_messages(const Case& c, const std::filesystem::path& composed);

/// Takes all tables of a place out of a bench.
void remove_places(ConfigNode& bench);

}  // namespace drivebench::regression
