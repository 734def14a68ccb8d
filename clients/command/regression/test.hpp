#pragma once

#include <string>
#include <vector>

#include "clients/regression/reports/reports.hpp"

namespace drivebench::command {

inline constexpr int kExitInvalid = 4;  ///< real time was not kept, and nothing failed

struct TestOptions {
  std::string program;  ///< version and build: results of another one are not taken for those of this one
  std::string suite;
  unsigned jobs = 1;
  unsigned retries = 0;  ///< of a case in which real time was not kept
  bool list = false;
  std::string filter{};  ///< part of the names of cases
  std::vector<std::string> wanted_tags{};
  std::string junit_file{};
  std::string json_file{};
  std::string html_file{};
  std::string timing_file{};  ///< `.json` or `.html`
  std::string keep_folder{};
  std::string shard{};                        ///< `2/4` or `auto`; empty: all cases
  std::string results_folder{};               ///< where results are kept between runs
  std::vector<std::string> merged_folders{};  ///< nothing runs: the results are there
  std::string shrunk_file{};                  ///< takes a smaller case that fails in the same way
  std::size_t shrink_runs = 300;              ///< at most
  unsigned slurm_tasks = 0;  ///< an array of so many tasks is submitted; 0: the cases run here
  bool status = false;       ///< nothing runs: how far the results are
  bool tap = false;
  bool github = false;
};

/// 0: all passed or were skipped, 1: one failed or had an error, 4: none failed, but real time was not kept
/// in one.
int exit_code_of(const regression::Totals& totals);

/// Runs the cases of a suite. Returns exit_code_of() them, or 2: usage.
int run_test(const TestOptions& options);

}  // namespace drivebench::command
