#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

/// Validators of numbers. CLI11's own let NaN pass, with which no comparison is true, read -1 as the largest
/// unsigned number, and print limits with 309 digits. --help shows these limits in words.
namespace drivebench::pages {

/// A real number, limits included.
CLI::Validator finite_between(double low, double high);

/// A whole number, limits included.
CLI::Validator whole_between(std::int64_t low, std::int64_t high);

/// For unsigned options.
CLI::Validator not_negative();

/// `1 - 127`, the limits of a validator, in the words of --help; empty where they only keep numbers from
/// overflowing.
std::string range_in_words(const std::string& range);

/// The upper limit of options in seconds: their nanoseconds fit into 64 bits.
inline constexpr double kMost_s = 1e9;

}  // namespace drivebench::pages
