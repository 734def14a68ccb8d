#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "clients/command/regression/pages/html_statistics.hpp"
#include "clients/regression/reports/reports.hpp"

namespace drivebench::command {

/// The signals of the failed checks with their limits as SVG pictures, from the trace of the result, and
/// every frequency response.
std::vector<std::string> plots_of(const regression::CaseResult& result);

/// The results of a suite as a page of one file that needs no network: every case with its values and checks,
/// and of those that have not passed the reasons, the signals of the failed checks with their limits, and
/// what the device under test printed; of all of them the frequency responses. Of more than a thousand cases
/// it shows statistics of what the checks measured, and whole only the first hundred that have not passed.
class HtmlReport {
 public:
  /// `bundles`: a folder whose bundles the page links to, from `page_folder`; empty: no links.
  HtmlReport(std::filesystem::path bundles, std::filesystem::path page_folder)
      : bundles_(std::move(bundles)), page_folder_(std::move(page_folder)) {}

  void add(const regression::CaseResult& result);
  std::string page(const std::string& suite, const regression::Totals& totals) const;

 private:
  std::string link_to_bundle(const regression::CaseResult& result) const;

  std::filesystem::path bundles_;
  std::filesystem::path page_folder_;
  HtmlStatistics statistics_;
  std::size_t cases_ = 0;
  std::size_t bad_ = 0;
  std::string rows_;      ///< of the first cases
  std::string bad_rows_;  ///< of the first that have not passed
  std::string sections_;
};

}  // namespace drivebench::command
