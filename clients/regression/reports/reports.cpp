#include "clients/regression/reports/reports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

std::string counted(std::size_t count, std::string_view what) {
  return count == 0 ? std::string() : fmt::format("{} {}", count, what);
}

/// The text of a diagnostic in TAP, and of a workflow command: one line.
std::string in_a_line(std::string_view text) {
  std::string line;
  for (const char c : text)
    line += c == '\n' || c == '\r' ? ' ' : c;
  return line;
}

/// GitHub's own escapes: % and ends of lines; in a property also : and ,.
std::string escaped_for_github(std::string_view text, bool is_property) {
  std::string out;
  for (const char c : text) {
    const bool escapes = c == '%' || c == '\n' || c == '\r' || (is_property && (c == ':' || c == ','));
    out += escapes ? fmt::format("%{:02X}", static_cast<unsigned>(c)) : std::string(1, c);
  }
  return out;
}

/// The last lines of what the device under test printed.
std::string indented_end(const std::string& output) {
  constexpr std::size_t kLines = 5;
  std::vector<std::string> lines;
  std::istringstream in(output);
  for (std::string line; std::getline(in, line);)
    lines.push_back(fmt::format("        | {}\n", printable(line)));
  const std::size_t left_out = lines.size() - std::min(lines.size(), kLines);
  return fmt::format("{}", fmt::join(lines.begin() + static_cast<std::ptrdiff_t>(left_out), lines.end(), ""));
}

int line_of(const CaseResult& result) {
  if (result.verdict != Verdict::kFail) return result.line;
  for (const Finding& finding : result.findings) {
    if (!finding.passed && finding.line > 0) return finding.line;
  }
  return result.line;
}

class TapReport final : public Report {
 public:
  using Report::Report;

  void begin(const std::string& /*suite*/, const Totals& totals) override {
    write(fmt::format("TAP version 13\n1..{}\n", totals.all()));
  }

  void add(const CaseResult& result) override {
    std::string name = in_a_line(result.name);
    std::ranges::replace(name, '#', '_');  // begins a directive
    std::string text = fmt::format("{} {} - {}", is_good(result) ? "ok" : "not ok", ++number_, name);
    if (result.verdict == Verdict::kSkipped) text += " # SKIP " + in_a_line(result.reason);
    text += '\n';
    if (!is_good(result)) {
      for (const std::string& reason : reasons_of(result))
        text += fmt::format("# {}: {}\n", word_of(result.verdict), in_a_line(reason));
    }
    write(text);
  }

 private:
  std::size_t number_ = 0;
};

class GithubReport final : public Report {
 public:
  using Report::Report;

  void begin(const std::string& /*suite*/, const Totals& /*totals*/) override {}

  void add(const CaseResult& result) override {
    if (is_good(result)) return;
    std::string reasons;
    for (const std::string& reason : reasons_of(result))
      reasons += (reasons.empty() ? "" : "\n") + reason;
    const std::string title = fmt::format("{} {}", word_of(result.verdict), result.name);
    write(fmt::format("::{} file={},line={},title={}::{}\n",
                      result.verdict == Verdict::kInvalid ? "warning" : "error",
                      escaped_for_github(result.file, true), line_of(result), escaped_for_github(title, true),
                      escaped_for_github(reasons, false)));
  }
};

}  // namespace

void Totals::add(const CaseResult& result) noexcept {
  bench_s += result.bench_s;
  switch (result.verdict) {
    case Verdict::kPass:
      ++passed;
      break;
    case Verdict::kFail:
      ++failed;
      break;
    case Verdict::kError:
      ++errors;
      break;
    case Verdict::kInvalid:
      ++invalid;
      break;
    case Verdict::kSkipped:
      ++skipped;
      break;
  }
}

bool is_good(const CaseResult& result) noexcept {
  return result.verdict == Verdict::kPass || result.verdict == Verdict::kSkipped;
}

std::string totals_text(const Totals& totals) {
  std::string text;
  for (const std::string& part : {counted(totals.passed, "passed"), counted(totals.failed, "failed"),
                                  counted(totals.errors, totals.errors == 1 ? "error" : "errors"),
                                  counted(totals.invalid, "invalid"), counted(totals.skipped, "skipped")}) {
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  }
  return text.empty() ? "no cases" : text;
}

std::vector<std::string> reasons_of(const CaseResult& result) {
  std::vector<std::string> reasons;
  if (!result.reason.empty()) reasons.push_back(result.reason);
  if (result.verdict != Verdict::kFail) return reasons;
  for (const Finding& finding : result.findings) {
    if (finding.passed) continue;
    std::string text = fmt::format("{}: {}", finding.name, finding.sentence);
    if (finding.at_s == finding.at_s) text += fmt::format(", at {:.6g} s", finding.at_s);
    reasons.push_back(text + fmt::format(" (line {})", finding.line));
  }
  return reasons;
}

std::string table_row(const CaseResult& result) {
  const std::string checks =
      fmt::format("{} check{}", result.findings.size(), result.findings.size() == 1 ? "" : "s");
  std::string text = result.verdict == Verdict::kSkipped
                         ? fmt::format("{:<8}{}\n", "skipped", result.name)
                         : fmt::format("{:<8}{:<56} {:>9.4g} s {:>10}\n", word_of(result.verdict),
                                       result.name, result.bench_s, checks);
  for (const std::string& reason : reasons_of(result))
    text += fmt::format("        {}\n", reason);
  if (result.verdict == Verdict::kError) text += indented_end(result.output);
  return text;
}

std::unique_ptr<Report> tap_report(Sink sink) {
  return std::make_unique<TapReport>(std::move(sink));
}

std::unique_ptr<Report> github_report(Sink sink) {
  return std::make_unique<GithubReport>(std::move(sink));
}

void write_reports(const SuiteResults& results, std::span<const std::unique_ptr<Report>> reports) {
  if (reports.empty()) return;
  for (const std::unique_ptr<Report>& report : reports)
    report->begin(results.suite, results.totals);
  results.each([reports](const CaseResult& result) {
    for (const std::unique_ptr<Report>& report : reports)
      report->add(result);
  });
  for (const std::unique_ptr<Report>& report : reports)
    report->end();
}

}  // namespace drivebench::regression
