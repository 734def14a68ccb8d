#include "clients/regression/results/results_folder.hpp"

#include <fmt/core.h>

#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>

#include "clients/regression/reports/case_json.hpp"
#include "clients/regression/results/fingerprints.hpp"
#include "protocols/json.hpp"

namespace drivebench::regression {

namespace fs = std::filesystem;
ResultsFolder::ResultsFolder(fs::path folder) : folder_(std::move(folder)) {
  fs::create_directories(folder_);
}

fs::path ResultsFolder::file_of(const std::string& name) const {
  return folder_ / fmt::format("{:016x}.json", text_hash(name));
}

std::optional<CaseResult> ResultsFolder::find(const std::string& name, const std::string& fingerprint) const {
  std::ifstream in(file_of(name), std::ios::binary);
  if (!in) return std::nullopt;
  const std::string text(std::istreambuf_iterator<char>(in), {});
  try {
    const Json file = parse_ordered_json(text);
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
