#include "clients/regression/reports/case_json.hpp"

#include <fmt/core.h>

#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

/// JSON has no infinity and no NaN.
Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

double number_of(const Json& value) {
  return value.is_null() ? std::nan("") : value.get<double>();
}

/// Rows of frequency [Hz], gain [dB], phase [deg], relative standard error.
Json response_json(const std::vector<ResponsePoint>& points) {
  Json rows = Json::array();
  for (const ResponsePoint& p : points)
    rows.push_back({p.hz, p.gain_db, p.phase_deg, p.error});
  return rows;
}

std::vector<ResponsePoint> response_of(const Json& rows) {
  std::vector<ResponsePoint> points;
  for (const Json& row : rows) {
    points.push_back({.hz = row.at(0).get<double>(),
                      .gain_db = row.at(1).get<double>(),
                      .phase_deg = row.at(2).get<double>(),
                      .error = row.at(3).get<double>()});
  }
  return points;
}

Json finding_json(const Finding& finding) {
  Json object = {{"name", finding.name},
                 {"kind", finding.kind},
                 {"axis", finding.axis},
                 {"signal", finding.signal},
                 {"passed", finding.passed},
                 {"applied", finding.applied},
                 {"measured", number(finding.measured)},
                 {"limit", number(finding.limit)},
                 {"unit", finding.unit},
                 {"at_s", number(finding.at_s)},
                 {"from_s", finding.from_s},
                 {"to_s", finding.to_s},
                 {"line", finding.line},
                 {"sentence", finding.sentence}};
  if (!finding.response.empty()) object["response"] = response_json(finding.response);
  return object;
}

Finding finding_of(const Json& object) {
  Finding finding;
  object.at("name").get_to(finding.name);
  object.at("kind").get_to(finding.kind);
  object.at("axis").get_to(finding.axis);
  object.at("signal").get_to(finding.signal);
  object.at("passed").get_to(finding.passed);
  object.at("applied").get_to(finding.applied);
  finding.measured = number_of(object.at("measured"));
  finding.limit = number_of(object.at("limit"));
  object.at("unit").get_to(finding.unit);
  finding.at_s = number_of(object.at("at_s"));
  object.at("from_s").get_to(finding.from_s);
  object.at("to_s").get_to(finding.to_s);
  object.at("line").get_to(finding.line);
  object.at("sentence").get_to(finding.sentence);
  if (object.contains("response")) finding.response = response_of(object.at("response"));
  return finding;
}

Verdict verdict_of(const std::string& word) {
  using enum Verdict;
  for (const Verdict each : {kPass, kFail, kError, kInvalid, kSkipped}) {
    if (word == word_of(each)) return each;
  }
  throw std::invalid_argument("no verdict: " + printable(word));
}

std::uint64_t hash_of(const std::string& text) {
  std::uint64_t hash = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  if (error == std::errc{} && end == text.data() + text.size()) return hash;
  throw std::invalid_argument("no hash: " + printable(text));
}

}  // namespace

Json case_json(const CaseResult& result) {
  Json values = Json::object();
  for (const auto& [label, value] : result.values)
    values[label] = value;
  Json checks = Json::array();
  for (const Finding& finding : result.findings)
    checks.push_back(finding_json(finding));
  Json object = {{"name", result.name},       {"file", result.file},
                 {"line", result.line},       {"values", values},
                 {"tags", result.tags},       {"verdict", word_of(result.verdict)},
                 {"reason", result.reason},   {"bench_s", result.bench_s},
                 {"samples", result.samples}, {"hash", fmt::format("{:016x}", result.hash)},
                 {"checks", checks},          {"output", result.output}};
  if (!result.messages.empty()) object["messages"] = result.messages;
  return object;
}

CaseResult case_of(const Json& object) {
  CaseResult result;
  object.at("name").get_to(result.name);
  object.at("file").get_to(result.file);
  object.at("line").get_to(result.line);
  for (const auto& [label, value] : object.at("values").items())
    result.values.emplace_back(label, value.get<std::string>());
  object.at("tags").get_to(result.tags);
  result.verdict = verdict_of(object.at("verdict").get<std::string>());
  object.at("reason").get_to(result.reason);
  object.at("bench_s").get_to(result.bench_s);
  object.at("samples").get_to(result.samples);
  result.hash = hash_of(object.at("hash").get<std::string>());
  for (const Json& each : object.at("checks"))
    result.findings.push_back(finding_of(each));
  object.at("output").get_to(result.output);
  if (object.contains("messages")) object.at("messages").get_to(result.messages);
  return result;
}

}  // namespace drivebench::regression
