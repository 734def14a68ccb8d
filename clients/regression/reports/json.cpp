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

class JsonReport final : public Report {
 public:
  using Report::Report;

  void begin(const std::string& suite, const Totals& totals) override {
    const Json head = {{"suite", suite},          {"passed", totals.passed},   {"failed", totals.failed},
                       {"errors", totals.errors}, {"invalid", totals.invalid}, {"skipped", totals.skipped}};
    std::string start = text_of(head);
    start.erase(start.rfind('\n'));
    write(start + ",\n \"cases\": [");
  }

  void add(const CaseResult& result) override {
    write((is_empty_ ? "\n" : ",\n") + indented(text_of(case_json(result))));
    is_empty_ = false;
  }

  void end() override { write(is_empty_ ? "]\n}\n" : "\n ]\n}\n"); }

 private:
  bool is_empty_ = true;
};

}  // namespace

std::unique_ptr<Report> json_report(Sink sink) {
  return std::make_unique<JsonReport>(std::move(sink));
}

}  // namespace drivebench::regression
