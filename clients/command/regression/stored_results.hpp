#pragma once

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

  /// Tells the case as it is now. Throws UsageError if its bench cannot be read.
  std::string fingerprint_of(const regression::Case& c);

  /// The result of the case with this name and fingerprint, if a folder has it.
  std::optional<regression::CaseResult> find(const std::string& name, const std::string& fingerprint) const;

  /// Keeps a result in the first folder. Any thread may call it.
  void put(const regression::CaseResult& result, const std::string& fingerprint) const;

 private:
  std::vector<regression::ResultsFolder> folders_;
  regression::Fingerprints fingerprints_;
};

}  // namespace drivebench::command
