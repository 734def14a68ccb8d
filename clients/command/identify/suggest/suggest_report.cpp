#include <fmt/format.h>

#include <cmath>
#include <iterator>

#include "clients/command/common/basics/json.hpp"
#include "clients/command/identify/suggest/suggest.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

using identification::Estimate;

/// Half of the 95 % interval of each parameter in percent of its value.
std::string intervals_text(const ExperimentForecast& forecast) {
  std::string text;
  for (const Estimate& e : forecast.result.parameters) {
    if (!counts(e) || !e.interval) continue;
    text +=
        fmt::format("{}{} {:.2g}", text.empty() ? "" : ", ", e.name, 100.0 * *e.interval / std::abs(e.value));
  }
  return text;
}

std::string outcome_text(const ExperimentForecast& forecast) {
  if (!forecast.problem.empty()) return forecast.problem;
  if (!std::isfinite(forecast.worst)) return "no motor follows it: " + forecast.result.excitation.verdict;
  return intervals_text(forecast) + (forecast.result.excitation.sufficient ? "" : "; not all is stated");
}

std::string worst_text(const ExperimentForecast& forecast) {
  if (!forecast.problem.empty() || !std::isfinite(forecast.worst)) return "-";
  return fmt::format("{:.2g} % ({})", 100.0 * forecast.worst, forecast.worst_name);
}

Json json_of(const ExperimentForecast& forecast) {
  Json intervals = Json::object();
  for (const Estimate& e : forecast.result.parameters)
    intervals[e.name] = e.interval ? Json(*e.interval / std::abs(e.value)) : Json(nullptr);
  return Json{{"name", forecast.name},
              {"problem", forecast.problem},
              {"stated", forecast.result.excitation.sufficient && forecast.problem.empty()},
              {"worst", std::isfinite(forecast.worst) ? Json(forecast.worst) : Json(nullptr)},
              {"worst_parameter", forecast.worst_name},
              {"relative_intervals", intervals},
              {"current_a", forecast.current_a},
              {"voltage_v", forecast.voltage_v},
              {"speed_rad_s", forecast.speed_rad_s},
              {"limit_used", forecast.limit_used}};
}

}  // namespace

std::string limits_text(const ExperimentLimits& limits) {
  std::string text = fmt::format("{:g} A, {:g} V", limits.current_a, limits.voltage_v);
  if (limits.speed_rad_s > 0.0) text += fmt::format(", {:g} rad/s", limits.speed_rad_s);
  return text + fmt::format(" and {:g} s", limits.duration_s);
}

std::string suggest_text(const SuggestReport& report) {
  std::string text = fmt::format("experiments for the motor of the bench {}, within {}\n\n", report.bench,
                                 limits_text(report.limits));
  auto out = std::back_inserter(text);
  constexpr const char* kRow = "  {:<15} {:>16} {:>9} {:>9} {:>11}  {}\n";
  fmt::format_to(out, kRow, "", "worst interval", "current", "voltage", "speed",
                 "95 % of each parameter [%]");
  const auto add = [&](const ExperimentForecast& f) {
    fmt::format_to(out, kRow, f.name, worst_text(f), fmt::format("{:.3g} A", f.current_a),
                   fmt::format("{:.3g} V", f.voltage_v), fmt::format("{:.3g} rad/s", f.speed_rad_s),
                   (f.limit_used > 1.0 ? "beyond a limit; " : "") + outcome_text(f));
  };
  for (const ExperimentForecast& each : report.existing)
    add(each);
  add(report.suggested);
  fmt::format_to(out, "\n{} trials on the bench\n", report.trials);
  if (report.ideal_currents)
    text += "its current sensor has neither steps nor noise: intervals of a real one are wider\n";
  if (!report.suggested.result.excitation.sufficient)
    text += "no experiment of this family within the limits states every parameter\n";
  return text;
}

std::string suggest_json(const SuggestReport& report) {
  Json existing = Json::array();
  for (const ExperimentForecast& each : report.existing)
    existing.push_back(json_of(each));
  return json_text(Json{{"motor", report.motor},
                        {"bench", report.bench},
                        {"limits",
                         {{"current_a", report.limits.current_a},
                          {"voltage_v", report.limits.voltage_v},
                          {"speed_rad_s",
                           report.limits.speed_rad_s > 0.0 ? Json(report.limits.speed_rad_s) : Json(nullptr)},
                          {"duration_s", report.limits.duration_s}}},
                        {"existing", existing},
                        {"suggested", json_of(report.suggested)},
                        {"trials", report.trials},
                        {"experiment", report.toml}},
                   2);
}

}  // namespace drivebench::command
