#pragma once

#include <functional>
#include <vector>

#include "clients/command/regression/cases/prepared_case.hpp"
#include "clients/regression/verdicts/result.hpp"

namespace drivebench::command {

struct SuiteSettings {
  unsigned jobs = 1;
  unsigned retries = 0;                 ///< of a case in which real time was not kept
  bool draws_plots = false;             ///< of failed checks
  bool measures_timing = false;         ///< of the devices under test
  std::filesystem::path keep_folder{};  ///< for bundles of cases that have not passed; empty: none is kept
  std::string program{};                ///< version and build, for the bundles
  /// Takes each result, with the place of its case, on the thread that made it, as soon as it is there. If it
  /// throws, the case is an error.
  std::function<void(std::size_t place, const regression::CaseResult&)> store{};
};

/// Runs cases on so many threads. `finished` hears of every result on the calling thread, in the order of the
/// cases, with the number of cases that have ended. After an interrupt the cases that have not begun are
/// errors. The results that are returned have no timing: for so many it would not fit into the memory.
std::vector<regression::CaseResult> run_suite(
    const std::vector<PreparedCase>& cases, const std::filesystem::path& folder,
    const SuiteSettings& settings,
    const std::function<void(const regression::CaseResult&, std::size_t ended)>& finished);

}  // namespace drivebench::command
