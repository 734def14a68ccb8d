#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/signals/catalogue.hpp"

/// Signals by their names, and as columns of CSV.
namespace drivebench::command {

/// The signals with these names. Throws UsageError for an unknown name.
std::vector<const Signal*> signals_named(const std::vector<std::string>& names);

/// The names without `tick` and `time_s`, for rows that begin with these two.
std::vector<std::string> without_time(std::vector<std::string> names);

/// `tick,time_s`, the names of further times, each behind a comma, `,i_a_a [A]...` and the end of the line.
std::string csv_header(const std::vector<const Signal*>& signals, std::string_view further_times = {});

/// The first two columns of a row.
void append_time(std::string& csv, std::uint64_t tick, std::uint64_t time_ns);

}  // namespace drivebench::command
