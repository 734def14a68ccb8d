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

}  // namespace

Totals totals_of(std::span<const CaseResult> results) noexcept {
  const auto count = [results](Verdict verdict) {
    return static_cast<std::size_t>(std::ranges::count(results, verdict, &CaseResult::verdict));
  };
  return {.passed = count(Verdict::kPass),
          .failed = count(Verdict::kFail),
          .errors = count(Verdict::kError),
          .invalid = count(Verdict::kInvalid),
          .skipped = count(Verdict::kSkipped)};
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

std::string to_tap(std::span<const CaseResult> results) {
  std::string text = fmt::format("TAP version 13\n1..{}\n", results.size());
  for (std::size_t i = 0; i < results.size(); ++i) {
    const CaseResult& result = results[i];
    const bool good = is_good(result);
    std::string name = in_a_line(result.name);
    std::ranges::replace(name, '#', '_');  // begins a directive
    text += fmt::format("{} {} - {}", good ? "ok" : "not ok", i + 1, name);
    if (result.verdict == Verdict::kSkipped) text += " # SKIP " + in_a_line(result.reason);
    text += '\n';
    if (good) continue;
    for (const std::string& reason : reasons_of(result))
      text += fmt::format("# {}: {}\n", word_of(result.verdict), in_a_line(reason));
  }
  return text;
}

std::string to_github(std::span<const CaseResult> results) {
  std::string text;
  for (const CaseResult& result : results) {
    if (is_good(result)) continue;
    std::string reasons;
    for (const std::string& reason : reasons_of(result))
      reasons += (reasons.empty() ? "" : "\n") + reason;
    text += fmt::format("::{} file={},line={},title={}::{}\n",
                        result.verdict == Verdict::kInvalid ? "warning" : "error",
                        escaped_for_github(result.file, true), line_of(result),
                        escaped_for_github(fmt::format("{} {}", word_of(result.verdict), result.name), true),
                        escaped_for_github(reasons, false));
  }
  return text;
}

}  // namespace drivebench::regression
