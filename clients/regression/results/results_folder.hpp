#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "clients/regression/verdicts/result.hpp"

namespace drivebench::regression {

/// A folder with a file for each result. A file appears whole or not at all, whatever is killed when, and
/// several programs may write into the folder at the same time.
class ResultsFolder {
 public:
  /// Makes the folder if it is not there. Throws std::filesystem::filesystem_error.
  explicit ResultsFolder(std::filesystem::path folder);

  /// The result of the case with this name, if the folder has it and its fingerprint is this one.
  std::optional<CaseResult> find(const std::string& name, const std::string& fingerprint) const;
  /// Throws std::runtime_error if the file cannot be written.
  void put(const CaseResult& result, const std::string& fingerprint) const;

 private:
  std::filesystem::path file_of(const std::string& name) const;

  std::filesystem::path folder_;
};

}  // namespace drivebench::regression
