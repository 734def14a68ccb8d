#include <fmt/core.h>

#include "clients/regression/reports/reports.hpp"
#include "protocols/markup.hpp"

namespace drivebench::regression {
namespace {

std::string outcome_xml(const CaseResult& result) {
  if (result.verdict == Verdict::kPass) return {};
  if (result.verdict == Verdict::kSkipped) {
    return fmt::format("      <skipped message=\"{}\"/>\n", markup(result.reason));
  }
  std::string text;
  const std::vector<std::string> reasons = reasons_of(result);
  for (const std::string& reason : reasons)
    text += reason + '\n';
  const char* const element = result.verdict == Verdict::kFail ? "failure" : "error";
  return fmt::format("      <{0} type=\"{1}\" message=\"{2}\">{3}</{0}>\n", element, word_of(result.verdict),
                     markup(reasons.empty() ? "" : reasons.front()), markup(text));
}

std::string case_xml(const std::string& suite, const CaseResult& result) {
  std::string inner = outcome_xml(result);
  if (!result.output.empty()) {
    inner += fmt::format("      <system-out>{}</system-out>\n", markup(result.output));
  }
  // The time is that of the bench: equal runs give equal reports.
  const std::string start =
      fmt::format("    <testcase classname=\"{}\" name=\"{}\" file=\"{}\" time=\"{:.6f}\"", markup(suite),
                  markup(result.name), markup(result.file), result.bench_s);
  return inner.empty() ? start + "/>\n" : start + ">\n" + inner + "    </testcase>\n";
}

class JunitReport final : public Report {
 public:
  using Report::Report;

  void begin(const std::string& suite, const Totals& totals) override {
    suite_ = suite;
    write(
        fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n"
                    "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\" "
                    "time=\"{:.6f}\">\n",
                    markup(suite), totals.all(), totals.failed, totals.errors + totals.invalid,
                    totals.skipped, totals.bench_s));
  }

  void add(const CaseResult& result) override { write(case_xml(suite_, result)); }

  void end() override { write("  </testsuite>\n</testsuites>\n"); }

 private:
  std::string suite_;
};

}  // namespace

std::unique_ptr<Report> junit_report(Sink sink) {
  return std::make_unique<JunitReport>(std::move(sink));
}

}  // namespace drivebench::regression
