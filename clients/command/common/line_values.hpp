#pragma once

#include <CLI/CLI.hpp>
#include <string_view>

#include "clients/command/common/commands.hpp"

/// Words of the command line as values, and what they must be.
namespace drivebench::command {

/// For unsigned options: without it -1 is 2^64 - 1.
CLI::Validator not_negative();

/// For real options. CLI11's own ranges let NaN pass, with which no comparison is true.
CLI::Validator finite_between(double low, double high);

/// The high of an option for which its own meaning has none.
inline constexpr double kMost = 1e15;
/// The same of one in seconds: they fit into nanoseconds of 64 bits.
inline constexpr double kMost_s = 1e9;

/// `0.1@0.0365`: N·m at seconds after the start of the trajectory. Throws UsageError.
LoadAt parse_load(std::string_view text);

/// `machine.rotor_resistance_ohm=5.85`. Throws UsageError.
ParameterSetting parse_setting(std::string_view text);

}  // namespace drivebench::command
