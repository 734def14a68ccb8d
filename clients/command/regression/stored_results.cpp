#include "clients/command/regression/stored_results.hpp"

#include "clients/command/common/errors.hpp"
#include "clients/command/regression/prepared_case.hpp"

namespace drivebench::command {

using regression::CaseResult;

StoredResults::StoredResults(const std::string& program, const std::vector<std::string>& folders)
    : fingerprints_(program) {
  try {
    for (const std::string& folder : folders)
      folders_.emplace_back(folder);
  } catch (const std::filesystem::filesystem_error& error) {
    throw UsageError(std::string("cannot make the folder for results: ") + error.what());
  }
}

std::optional<CaseResult> StoredResults::find(const regression::Case& c) {
  std::string fingerprint;
  try {
    fingerprint = fingerprints_.of(c, bench_file_of(c));
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
  of_case_.emplace(c.name, fingerprint);
  for (const regression::ResultsFolder& folder : folders_) {
    if (std::optional<CaseResult> result = folder.find(c.name, fingerprint)) return result;
  }
  return std::nullopt;
}

void StoredResults::put(const CaseResult& result) const {
  folders_.front().put(result, of_case_.at(result.name));
}

}  // namespace drivebench::command
