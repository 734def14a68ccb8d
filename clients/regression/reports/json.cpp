#include "protocols/json.hpp"
#include "clients/regression/reports/case_json.hpp"
#include "clients/regression/reports/reports.hpp"

namespace drivebench::regression {
namespace {

std::string text_of(const Json& json) {
  return json_text(json, 1);
}

/// The lines of a text that stands so deep within another.
std::string indented(const std::string& text) {
  constexpr std::string_view kDeep = "  ";
  std::string out(kDeep);
  for (const char c : text) {
    out += c;
    if (c == '\n') out += kDeep;
  }
  return out;
}

}  // namespace

void write_json(const SuiteResults& results, const Sink& sink) {
  const Totals& totals = results.totals;
  const Json head = {{"suite", results.suite},  {"passed", totals.passed},   {"failed", totals.failed},
                     {"errors", totals.errors}, {"invalid", totals.invalid}, {"skipped", totals.skipped}};
  std::string start = text_of(head);
  start.erase(start.rfind('\n'));
  sink(start + ",\n \"cases\": [");
  bool is_first = true;
  results.each([&](const CaseResult& result) {
    sink((is_first ? "\n" : ",\n") + indented(text_of(case_json(result))));
    is_first = false;
  });
  sink(is_first ? "]\n}\n" : "\n ]\n}\n");
}

}  // namespace drivebench::regression
