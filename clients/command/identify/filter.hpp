#pragma once

#include <optional>
#include <string>

namespace drivebench::command {

/// A Butterworth low-pass of the book, 2.8: its numbers, or a column of a file through it.
struct FilterOptions {
  bool json = false;
  int order = 3;
  double cutoff_hz = 100.0;
  double rate_hz = 0.0;  ///< 0: that of the file

  std::string file{};    ///< CSV; empty: numbers alone
  std::string column{};  ///< its header, with or without the unit
  std::string time = "time_s";
  std::string out_file{};  ///< CSV; empty: standard output
};
int run_filter(const FilterOptions& options);

}  // namespace drivebench::command
