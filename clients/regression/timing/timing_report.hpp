#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "clients/regression/timing/device_timing.hpp"

namespace drivebench::regression {

/// The timing of all cases with one way, in real time also with one period.
struct TimingGroup {
  std::size_t cases = 0;
  DeviceTiming all{};
};

/// The object of a case in the JSON report.
std::string timing_case_json(std::string_view name, const DeviceTiming& timing);
/// The report around the objects of its cases, which stand in one line each.
std::string timing_json(std::string_view suite, const std::vector<TimingGroup>& groups,
                        const std::string& cases);

/// The row of a case on the page, with its drawing if wanted.
std::string timing_case_row(std::string_view name, const DeviceTiming& timing, bool draws);
/// The page around the rows of its cases; `left_out` of them have none.
std::string timing_page(std::string_view suite, const std::vector<TimingGroup>& groups,
                        const std::string& rows, std::size_t left_out);

/// The timing of a suite: a file of its own, because it is different each time, whereas the reports of equal
/// runs have equal bytes.
class TimingReport {
 public:
  enum class Format { kJson, kPage };
  explicit TimingReport(Format format) noexcept : format_(format) {}

  void add(std::string_view name, const DeviceTiming& timing);
  std::string text(std::string_view suite) const;
  /// For the terminal: a line for each group.
  std::string summary() const;

 private:
  Format format_;
  std::vector<TimingGroup> groups_{};
  std::size_t cases_ = 0;
  std::string parts_{};  ///< the objects or rows of the cases
};

}  // namespace drivebench::regression
