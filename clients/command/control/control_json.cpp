#include "clients/command/control/control_json.hpp"

#include "clients/command/common/basics/json.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/control/presets/presets.hpp"
#include "protocols/json.hpp"

namespace drivebench::reference {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ControlReport, bench, mode, axis, preset, failure, samples, missed_ticks,
                                   late_ticks, first_tick, duration_s, wall_s, angle_source, speed_source,
                                   peak_error_rad, final_error_rad, peak_error_counts, final_error_counts,
                                   final_true_error_counts, peak_speed_rad_s, peak_speed_error_rad_s,
                                   peak_current_a, peak_field_current_a, peak_command_voltage_v,
                                   peak_command_current_a, peak_voltage_v, saturated_samples, peak_telemetry,
                                   exchange_p50_us, exchange_p99_us, exchange_max_us)

}  // namespace drivebench::reference

namespace drivebench::command {

namespace {

Json as_json(const std::vector<control::Gain>& gains) {
  Json out = Json::object();
  for (const control::Gain& gain : gains)
    out[gain.name] = gain.value;
  return out;
}

Json as_json(const Difference& d) {
  return {{"largest", d.largest},
          {"largest_tick", d.largest_tick},
          {"rms", d.rms()},
          {"first_tick_beyond", d.first_tick_beyond}};
}

}  // namespace

std::string presets_json() {
  Json out = Json::array();
  for (const control::Preset& preset : control::presets()) {
    const control::Requirements& needs = preset.needs;
    const std::optional<control::Run> run = made_as_it_stands(preset);
    out.push_back({{"name", preset.name},
                   {"source", preset.source},
                   {"expectation", preset.expectation},
                   {"bench", preset.bench},
                   {"machine_kind", needs.machine_kind},
                   {"sample_rate_hz", run ? Json(run->timing().sample_rate_hz) : Json(nullptr)},
                   {"samples", run ? Json(run->planned_samples()) : Json(nullptr)},
                   {"counts_per_revolution", needs.counts_per_revolution},
                   {"pole_pairs", needs.pole_pairs},
                   {"voltage_limit_v", needs.voltage_limit_v},
                   {"commands", needs.quantity == control::Quantity::kVoltage ? "voltages" : "currents"},
                   {"signal", needs.signal},
                   {"drives_second", needs.drives_second},
                   {"gains", as_json(preset.gains())}});
  }
  return json_text(out, 2);
}

std::string gains_json(const std::vector<control::Gain>& gains) {
  return json_text(as_json(gains), 2);
}

std::string comparison_json(const Comparison& c) {
  const auto in_counts = [&c](double rad) {
    return c.counts_per_rad > 0.0 ? Json(rad * c.counts_per_rad) : Json(nullptr);
  };
  Json out = {
      {"recording", c.recording},   {"axis", c.axis},       {"preset", c.preset}, {"unit", c.unit},
      {"first_tick", c.first_tick}, {"samples", c.samples}, {"whole", c.whole},   {"threshold", c.threshold}};
  out["commands"] = as_json(c.commands);
  for (const auto& [name, difference] : c.terminals)
    out["terminals"][name] = as_json(difference);
  out["tracking"] = {{"peak_error_rad", c.tracking_rad.largest},
                     {"peak_error_tick", c.tracking_rad.largest_tick},
                     {"rms_error_rad", c.tracking_rad.rms()},
                     {"final_error_rad", c.final_error_rad},
                     {"peak_error_counts", in_counts(c.tracking_rad.largest)},
                     {"final_error_counts", in_counts(c.final_error_rad)}};
  out["with"] = nullptr;
  if (!c.other.empty()) {
    out["with"] = {{"recording", c.other},
                   {"commands", as_json(c.other_commands)},
                   {"angle_rad", as_json(c.other_angle_rad)}};
  }
  return json_text(out, 2);
}

std::string control_json(const ControlReport& report) {
  return json_text(nlohmann::json(report));
}

std::optional<ControlReport> parse_control(std::string_view line) {
  return parsed<ControlReport>(line);
}

}  // namespace drivebench::command
