#include "clients/command/regression/stored_results.hpp"

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/regression/cases/prepared_case.hpp"

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

std::string StoredResults::fingerprint_of(const regression::Case& c) {
  try {
    return fingerprints_.of(c, bench_file_of(c));
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

std::optional<CaseResult> StoredResults::find(const std::string& name, const std::string& fingerprint) const {
  for (const regression::ResultsFolder& folder : folders_) {
    if (std::optional<CaseResult> result = folder.find(name, fingerprint)) return result;
  }
  return std::nullopt;
}

void StoredResults::put(const CaseResult& result, const std::string& fingerprint) const {
  folders_.front().put(result, fingerprint);
}

}  // namespace drivebench::command
