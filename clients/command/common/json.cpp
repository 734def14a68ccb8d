#include "clients/command/common/json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "clients/command/common/session.hpp"
#include "clients/command/control/control_presets.hpp"
#include "clients/control/presets/presets.hpp"
#include "clients/identification/experiments/named_experiments.hpp"
#include "clients/identification/motors/motors.hpp"

namespace nlohmann {

/// What is not known is null.
template <class T>
struct adl_serializer<std::optional<T>> {
  static void to_json(json& out, const std::optional<T>& value) {
    if (value) {
      out = *value;
    } else {
      out = nullptr;
    }
  }
  static void from_json(const json& in, std::optional<T>& value) {
    if (in.is_null()) {
      value.reset();
    } else {
      value = in.get<T>();
    }
  }
};

}  // namespace nlohmann

namespace drivebench::command {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ControlReport, bench, mode, axis, preset, failure, samples, missed_ticks,
                                   late_ticks, first_tick, duration_s, wall_s, angle_source, speed_source,
                                   peak_error_rad, final_error_rad, peak_error_counts, final_error_counts,
                                   final_true_error_counts, peak_speed_rad_s, peak_speed_error_rad_s,
                                   peak_current_a, peak_field_current_a, peak_command_voltage_v,
                                   peak_command_current_a, peak_voltage_v, saturated_samples, peak_telemetry,
                                   exchange_p50_us, exchange_p99_us, exchange_max_us)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ServerReady, tcp, mode, bench)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ServerVerdict, ticks, late_ticks, worst_lateness_us, exact, realtime_valid,
                                   state_hash, recording, sentence)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(DemoReplay, equal, ticks, samples, state_hash, problem)

namespace {

using Json = nlohmann::ordered_json;

/// A line that is a JSON object with this event; a discarded value otherwise.
nlohmann::json object_of(std::string_view line, std::string_view event) {
  nlohmann::json object = nlohmann::json::parse(line, nullptr, false);
  if (!object.is_object()) return nlohmann::json(nlohmann::json::value_t::discarded);
  if (!event.empty() && object.value("event", std::string()) != event) {
    return nlohmann::json(nlohmann::json::value_t::discarded);
  }
  return object;
}

template <class T>
std::optional<T> parsed(std::string_view line, std::string_view event) {
  try {
    const nlohmann::json object = object_of(line, event);
    if (object.is_discarded()) return std::nullopt;
    return object.get<T>();
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

Json faults_of(const v1::BenchDescription& bench, std::uint64_t faults) {
  Json names = Json::array();
  for (const v1::FaultDescription& fault : bench.faults()) {
    if ((faults & fault.bit()) != 0) names.push_back(fault.name());
  }
  return names;
}

Json injected_of(const v1::BenchDescription& bench, std::uint64_t injected) {
  Json names = Json::array();
  for (const v1::InjectableFaultDescription& fault : bench.injectable_faults()) {
    if ((injected & fault.bit()) != 0) names.push_back(fault.name());
  }
  return names;
}

Json value_as_json(const Signal& signal, const Sample& sample) {
  if (signal.type == SignalType::kUnsigned) return sample.*signal.as_unsigned;
  if (signal.type == SignalType::kSigned) return sample.*signal.as_signed;
  return sample.*signal.as_real;
}

Json parameters_of(const v1::AxisDescription& axis) {
  Json rows = Json::array();
  for (const v1::ParameterDescription& p : axis.parameters()) {
    rows.push_back({{"name", p.name()},
                    {"value", p.value()},
                    {"unit", p.unit()},
                    {"minimum", p.minimum()},
                    {"maximum", p.maximum()},
                    {"integer", p.integer()},
                    {"live", p.live()},
                    {"meaning", p.meaning()}});
    for (const std::string& word : p.words())
      rows.back()["words"].push_back(word);
  }
  return rows;
}

const char* name_of(v1::SignalDescription::Kind kind) {
  if (kind == v1::SignalDescription::KIND_STATUS) return "status";
  if (kind == v1::SignalDescription::KIND_SENSOR) return "sensor";
  return "truth";
}

Json optional_json(std::optional<double> value) {
  return value ? Json(*value) : Json(nullptr);
}

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
          {"first_tick_beyond", d.first_tick_beyond ? Json(*d.first_tick_beyond) : Json(nullptr)}};
}

Json demo_run(const DemoRun& run) {
  return {{"peak_error_counts", optional_json(run.control.peak_error_counts)},
          {"final_error_counts", optional_json(run.control.final_error_counts)},
          {"peak_current_a", run.control.peak_current_a},
          {"peak_voltage_v", run.control.peak_voltage_v.value_or(0.0)},
          {"duration_s", run.control.duration_s},
          {"samples", run.control.samples},
          {"missed_ticks", run.control.missed_ticks},
          {"late_ticks", run.verdict.late_ticks},
          {"worst_lateness_us", run.verdict.worst_lateness_us},
          {"exchange_p50_us", run.control.exchange_p50_us},
          {"exchange_p99_us", run.control.exchange_p99_us},
          {"exact", run.verdict.exact},
          {"realtime_valid", run.verdict.realtime_valid},
          {"state_hash", run.verdict.state_hash},
          {"verdict", run.verdict.sentence},
          {"recording", run.recording},
          {"attempts", run.attempts},
          {"failure", run.failure}};
}

}  // namespace

std::string describe_json(const v1::Welcome& welcome) {
  const v1::BenchDescription& bench = welcome.bench();
  Json out = {{"bench", bench.name()},
              {"mode", command::name_of(bench.mode())},
              {"build_id", welcome.build_id()},
              {"protocol", welcome.protocol()},
              {"period_s", bench.period_s()},
              {"substeps", bench.substeps()},
              {"command_delay_ticks", bench.command_delay_ticks()},
              {"watchdog_ticks", bench.watchdog_ticks()},
              {"lease_s", bench.lease_s()},
              {"seed", bench.seed()},
              {"configuration_hash", fmt::format("{:016x}", bench.configuration_hash())}};
  for (const v1::AxisDescription& axis : bench.axes()) {
    out["axes"].push_back({{"name", axis.name()},
                           {"machine", axis.machine()},
                           {"machine_kind", axis.machine_kind()},
                           {"phases", axis.phases()},
                           {"connection", axis.connection()},
                           {"field_winding", axis.field_winding()},
                           {"drive_kind", axis.drive_kind()},
                           {"shares_shaft_with", axis.shares_shaft_with()},
                           {"parameters", parameters_of(axis)}});
  }
  for (const v1::SignalDescription& s : bench.signals()) {
    out["signals"].push_back({{"name", s.name()},
                              {"unit", s.unit()},
                              {"kind", name_of(s.kind())},
                              {"minimum", s.minimum()},
                              {"maximum", s.maximum()},
                              {"meaning", s.meaning()}});
  }
  for (const v1::FaultDescription& f : bench.faults()) {
    out["faults"].push_back(
        {{"bit", f.bit()}, {"name", f.name()}, {"latched", f.latched()}, {"meaning", f.meaning()}});
  }
  for (const v1::InjectableFaultDescription& f : bench.injectable_faults()) {
    out["injectable_faults"].push_back({{"bit", f.bit()},
                                        {"name", f.name()},
                                        {"unit", f.unit()},
                                        {"minimum", f.minimum()},
                                        {"maximum", f.maximum()},
                                        {"integer", f.integer()},
                                        {"meaning", f.meaning()}});
  }
  return out.dump(2);
}

std::string status_json(const v1::Status& status, const v1::BenchDescription& bench) {
  Json out = {{"mode", command::name_of(status.mode())},
              {"tick", status.tick()},
              {"late_ticks", status.late_ticks()},
              {"worst_lateness_s", status.worst_lateness_s()},
              {"sessions", status.sessions()},
              {"recording", status.recording()},
              {"recording_gaps", status.recording_gaps()},
              {"recording_over", status.recording_over()},
              {"state_hash", status.state_hash() == 0 ? "" : fmt::format("{:016x}", status.state_hash())},
              {"notes", Json::array()},
              {"transports", Json::array()},
              {"axes", Json::array()}};
  for (const std::string& note : status.notes())
    out["notes"].push_back(note);
  for (const v1::TransportStatus& transport : status.transports()) {
    Json counts = Json::object();
    for (const v1::TransportStatus::Count& count : transport.counts())
      counts[count.name()] = count.value();
    out["transports"].push_back(
        {{"name", transport.name()}, {"state", transport.state()}, {"counts", counts}});
  }
  for (const v1::AxisSample& each : status.axes()) {
    const Sample sample = plain(each.sample());
    Json axis = {{"axis", each.axis()},
                 {"faults_set", faults_of(bench, sample.faults)},
                 {"injected_set", injected_of(bench, sample.injected)}};
    for (const Signal& signal : kSignals)
      axis[std::string(signal.name)] = value_as_json(signal, sample);
    out["axes"].push_back(axis);
  }
  return out.dump(2);
}

std::string sample_json(const Sample& sample, std::uint32_t axis, std::uint64_t dropped,
                        const std::vector<const Signal*>& signals) {
  Json out = {{"axis", axis}, {"dropped", dropped}};
  for (const Signal* signal : signals)
    out[std::string(signal->name)] = value_as_json(*signal, sample);
  return out.dump();
}

std::string change_json(std::uint32_t axis, std::string_view name, double value, std::uint64_t tick) {
  return Json{{"axis", axis}, {"name", name}, {"value", value}, {"tick", tick}}.dump();
}

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
                   {"gains", as_json(preset.gains())}});
  }
  return out.dump(2);
}

std::string gains_json(const std::vector<control::Gain>& gains) {
  return as_json(gains).dump(2);
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
  return out.dump(2);
}

std::string control_json(const ControlReport& report) {
  return nlohmann::json(report).dump();
}

std::string export_json(std::string_view out_file, std::string_view axis, std::uint64_t rows,
                        std::string_view problem) {
  return Json{{"out", out_file}, {"axis", axis}, {"rows", rows}, {"problem", problem}}.dump();
}

namespace {

Json as_json(const v1::ExperimentInfo& info) {
  Json out{{"id", info.id()},
           {"state", word_of(info.state())},
           {"position", info.position()},
           {"user", info.user()}};
  if (info.period_s() == 0.0) return out;  // somebody else's
  out["label"] = info.label();
  out["shared"] = info.shared();
  out["mode"] = info.mode() == v1::MODE_REALTIME ? "realtime" : "free";
  out["ticks"] = info.ticks();
  out["tick"] = info.tick();
  out["rows"] = info.rows();
  out["decimation"] = info.decimation();
  out["period_s"] = info.period_s();
  out["signals"] = std::vector<std::string>(info.signals().begin(), info.signals().end());
  out["reason"] = info.reason();
  if (info.has_verdict()) {
    out["state_hash"] = fmt::format("{:016x}", info.verdict().state_hash());
    out["late_ticks"] = info.verdict().late_ticks();
    out["sentence"] = info.verdict().sentence();
  }
  return out;
}

}  // namespace

std::string experiment_json(const v1::ExperimentInfo& info, std::string_view out_file,
                            std::uint64_t resumed) {
  Json out = as_json(info);
  out["out"] = out_file;
  out["resumed"] = resumed;
  return out.dump();
}

std::string experiments_json(const v1::ExperimentList& list) {
  Json out = Json::array();
  for (const v1::ExperimentInfo& info : list.experiments())
    out.push_back(as_json(info));
  return Json{{"experiments", out}}.dump(2);
}

std::string identify_json(const IdentifyReport& report) {
  const identification::Processing& p = report.settings.processing;
  Json out = Json::parse(to_json(report.result));
  out["motor"] = report.motor;
  out["source"] = report.source;
  out["experiment"] = report.experiment ? as_json(*report.experiment) : Json(nullptr);
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
  return out.dump(2, ' ', false, Json::error_handler_t::replace);
}

std::string named_experiments_json() {
  Json out = Json::array();
  for (const identification::NamedExperiment& each : identification::named_experiments())
    out.push_back(Json{{"motor", each.motor},
                       {"name", each.name},
                       {"file", each.file},
                       {"bench", each.bench},
                       {"summary", each.summary}});
  return Json{{"experiments", out}}.dump(2);
}

std::string demo_json(const DemoReport& report) {
  return Json{{"lockstep", demo_run(report.lockstep)},
              {"realtime", demo_run(report.realtime)},
              {"replay",
               {{"equal", report.replay.equal},
                {"ticks", report.replay.ticks},
                {"samples", report.replay.samples},
                {"state_hash", report.replay.state_hash},
                {"problem", report.replay.problem}}}}
      .dump(2);
}

std::string error_json(std::string_view kind, std::string_view message, std::string_view field) {
  return Json{{"error", {{"kind", kind}, {"message", message}, {"field", field}}}}.dump();
}

std::optional<ServerReady> parse_ready(std::string_view line) {
  return parsed<ServerReady>(line, "ready");
}

std::optional<ServerVerdict> parse_verdict(std::string_view line) {
  return parsed<ServerVerdict>(line, "verdict");
}

std::optional<ControlReport> parse_control(std::string_view line) {
  return parsed<ControlReport>(line, "");
}

std::optional<DemoReplay> parse_replay(std::string_view line) {
  return parsed<DemoReplay>(line, "");
}

}  // namespace drivebench::command
