#include "clients/command/common/basics/json.hpp"
#include "clients/command/experiment/experiment_json.hpp"
#include "clients/command/identify/classical/classical_report.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {

std::string classical_json(const ClassicalReport& report) {
  Json out = parse_ordered_json(to_json(report.result));
  out["motor"] = "im";
  out["experiment"] = report.experiment;
  Json readings = Json::object();
  for (const TestRun& run : report.runs) {
    const identification::TerminalReading& reading = run.reading;
    readings[run.name] = Json{{"source", run.source},
                              {"experiment", run.experiment ? json_of(*run.experiment) : Json(nullptr)},
                              {"from_s", reading.from_s},
                              {"to_s", reading.to_s},
                              {"frequency_hz", reading.meter.frequency_hz},
                              {"voltage_v", reading.meter.voltage_v},
                              {"current_a", reading.meter.current_a},
                              {"active_w", reading.meter.active_w},
                              {"reactive_var", reading.meter.reactive_var},
                              {"real_interval_ohm", reading.real_interval_ohm},
                              {"imaginary_interval_ohm", reading.imaginary_interval_ohm},
                              {"unbalance", reading.unbalance},
                              {"parts", reading.parts},
                              {"slip", run.slip},
                              {"slip_bound", run.slip_bound}};
  }
  out["readings"] = readings;
  Json structural = Json::object();
  for (const identification::Estimate& e : report.result.parameters) {
    if (const std::optional<double> error = structural_error(report, e))
      structural[e.name] =
          Json{{"error", *error}, {"with_branch", identification::value_of(*report.with_branch, e.name)}};
  }
  out["structural"] = structural;
  out["losses"] = Json(nullptr);
  if (report.losses) {
    out["losses"] = Json{{"power_w", report.losses->power_w},
                         {"interval_w", report.losses->interval_w},
                         {"slip_angle", report.losses->slip_angle},
                         {"inductance_bias", report.losses->inductance_bias}};
  }
  return json_text(out, 2);
}

}  // namespace drivebench::command
