#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/regression/results/fingerprints.hpp"
#include "clients/regression/results/results_folder.hpp"

namespace drivebench::command {

/// Results of earlier runs and of runs on other machines, in folders.
class StoredResults {
 public:
  /// Makes folders that are not there. Throws UsageError.
  StoredResults(const std::string& program, const std::vector<std::string>& folders);

  /// The result of a case, if a folder has one of the case as it is now. Throws UsageError if the bench of
  /// the case cannot be read.
  std::optional<regression::CaseResult> find(const regression::Case& c);

  /// Keeps the result of a case that find() was asked for in the first folder. Any thread may call it.
  void put(const regression::CaseResult& result) const;

 private:
  std::vector<regression::ResultsFolder> folders_;
  regression::Fingerprints fingerprints_;
  std::map<std::string, std::string> of_case_;  ///< fingerprints by the names of cases
};

}  // namespace drivebench::command
