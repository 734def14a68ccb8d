#pragma once

#include <string>

#include "clients/command/datasheet/sheet.hpp"

namespace drivebench::command {

struct NewBenchOptions {
  Sheet sheet{};
  std::string motor{};  ///< a motor file, or its name in configs/motors
  std::string mode = "lockstep";
  double period_us = 100.0;
  std::string out_file{};  ///< empty: standard output
};

/// Link voltage, largest current and encoder, each in the forms of data sheets.
std::span<const Quantity> bench_quantities();

/// Writes a bench file for a motor file and, unless it goes to standard output, has the server check it.
/// Asks on a terminal for what is missing; throws UsageError elsewhere.
int run_new_bench(const NewBenchOptions& options);

}  // namespace drivebench::command
