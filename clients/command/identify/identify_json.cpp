#include "clients/command/identify/identify_json.hpp"

#include <cmath>

#include "clients/command/common/basics/json.hpp"
#include "clients/command/experiment/experiment_json.hpp"
#include "clients/identification/named_experiments.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {

std::string identify_json(const IdentifyReport& report) {
  const identification::Processing& p = report.settings.processing;
  Json out = parse_ordered_json(to_json(report.result));
  out["motor"] = report.motor;
  out["source"] = report.source;
  out["experiment"] = report.experiment ? json_of(*report.experiment) : Json(nullptr);
  out["settings"] = Json{{"period_s", report.period_s},
                         {"pole_pairs", report.settings.pole_pairs},
                         {"phases", report.settings.three_phase ? 3 : 2},
                         {"counts_per_revolution", report.settings.counts_per_revolution},
                         {"voltage_shift", p.voltage_shift},
                         {"from_s", p.from_s},
                         {"to_s", p.to_s},
                         {"current_hz", p.current.cutoff_hz},
                         {"voltage_hz", p.voltage.cutoff_hz},
                         {"shaft_hz", p.shaft.cutoff_hz},
                         {"shaft_chosen", p.shaft_chosen},
                         {"order", p.current.order}};
  Json signals = Json::object();
  if (report.validation) {
    for (const identification::Resimulated& signal : report.validation->signals) {
      signals[signal.name] =
          Json{{"unit", signal.unit},
               {"rms_error", signal.rms_error},
               {"normalised", std::isfinite(signal.normalised) ? Json(signal.normalised) : Json(nullptr)}};
    }
  }
  out["validation"] = Json{{"from_rest", report.validation && report.validation->from_rest},
                           {"signals", signals},
                           {"problem", report.validation_problem}};
  return json_text(out, 2);
}

std::string named_experiments_json() {
  Json out = Json::array();
  for (const identification::NamedExperiment& each : identification::named_experiments())
    out.push_back(Json{{"motor", each.motor},
                       {"name", each.name},
                       {"file", each.file},
                       {"bench", each.bench},
                       {"summary", each.summary},
                       {"test", each.test != identification::TerminalTest::kNone}});
  return json_text(Json{{"experiments", out}}, 2);
}

}  // namespace drivebench::command
