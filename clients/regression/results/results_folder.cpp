#include "clients/regression/results/results_folder.hpp"

#include <fmt/core.h>

#include <fstream>
#include <random>
#include <stdexcept>

#include "clients/regression/reports/case_json.hpp"
#include "clients/regression/results/fingerprints.hpp"
#include "protocols/document.hpp"
#include "protocols/json.hpp"

namespace drivebench::regression {

namespace fs = std::filesystem;
namespace {

/// Far more than a result has with its plots and what the device under test printed.
constexpr std::size_t kMostResultBytes = std::size_t{256} << 20U;

}  // namespace

ResultsFolder::ResultsFolder(fs::path folder) : folder_(std::move(folder)) {
  fs::create_directories(folder_);
}

fs::path ResultsFolder::file_of(const std::string& name) const {
  return folder_ / fmt::format("{:016x}.json", text_hash(name));
}

std::optional<CaseResult> ResultsFolder::find(const std::string& name, const std::string& fingerprint) const {
  const FileText content = read_file(file_of(name), kMostResultBytes);
  if (!content.why_not.empty()) return std::nullopt;
  try {
    const Json file = parse_ordered_json(content.text);
    if (file.at("fingerprint").get<std::string>() != fingerprint) return std::nullopt;
    CaseResult result = case_of(file.at("case"));
    if (result.name != name) return std::nullopt;
    file.at("plots").get_to(result.plots);
    return result;
  } catch (const std::exception&) {
    return std::nullopt;  // it is none of ours: the case has no result
  }
}

void ResultsFolder::put(const CaseResult& result, const std::string& fingerprint) const {
  const Json file = {{"fingerprint", fingerprint}, {"case", case_json(result)}, {"plots", result.plots}};
  const fs::path target = file_of(result.name);
  fs::path unfinished = target;
  unfinished += fmt::format(".{:08x}", std::random_device{}());  // others may write the same result
  std::ofstream out(unfinished, std::ios::binary);
  out << json_text(file) << '\n';
  out.close();
  std::error_code error;
  if (out) fs::rename(unfinished, target, error);
  if (out && !error) return;
  fs::remove(unfinished, error);
  throw std::runtime_error("cannot write " + target.string());
}

}  // namespace drivebench::regression
