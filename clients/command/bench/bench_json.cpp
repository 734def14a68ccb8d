#include "clients/command/bench/bench_json.hpp"

#include <fmt/core.h>

#include "clients/command/common/basics/json.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

/// The names of the bits that are set.
template <class Descriptions>
Json names_in(const Descriptions& descriptions, std::uint64_t bits) {
  Json names = Json::array();
  for (const auto& each : descriptions) {
    if ((bits & each.bit()) != 0) names.push_back(each.name());
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

const char* kind_name(v1::SignalDescription::Kind kind) {
  if (kind == v1::SignalDescription::KIND_STATUS) return "status";
  if (kind == v1::SignalDescription::KIND_SENSOR) return "sensor";
  return "truth";
}

}  // namespace

std::string describe_json(const v1::Welcome& welcome) {
  const v1::BenchDescription& bench = welcome.bench();
  Json out = {{"bench", bench.name()},
              {"mode", link::name_of(bench.mode())},
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
                           {"shares_amplifier_with", axis.shares_amplifier_with()},
                           {"parameters", parameters_of(axis)}});
  }
  for (const v1::SignalDescription& s : bench.signals()) {
    out["signals"].push_back({{"name", s.name()},
                              {"unit", s.unit()},
                              {"kind", kind_name(s.kind())},
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
  return json_text(out, 2);
}

std::string status_json(const v1::Status& status, const v1::BenchDescription& bench) {
  Json out = {{"mode", link::name_of(status.mode())},
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
                 {"faults_set", names_in(bench.faults(), sample.faults)},
                 {"latched_set", names_in(bench.faults(), latched_faults(bench, sample.faults))},
                 {"injected_set", names_in(bench.injectable_faults(), sample.injected)}};
    for (const Signal& signal : kSignals)
      axis[std::string(signal.name)] = value_as_json(signal, sample);
    out["axes"].push_back(axis);
  }
  return json_text(out, 2);
}

std::string sample_json(const Sample& sample, const v1::BenchDescription& bench, std::uint32_t axis,
                        std::uint64_t dropped, const std::vector<const Signal*>& signals) {
  Json out = {{"bench", bench.name()},
              {"axis", axis},
              {"dropped", dropped},
              {"tick", sample.tick},
              {"time_s", static_cast<double>(sample.tick) * bench.period_s()}};
  for (const Signal* signal : signals)
    out[std::string(signal->name)] = value_as_json(*signal, sample);
  return json_text(out);
}

std::string change_json(std::uint32_t axis, std::string_view name, double value, std::uint64_t tick) {
  return json_text(Json{{"axis", axis}, {"name", name}, {"value", value}, {"tick", tick}});
}

std::string state_json(std::string_view done, std::uint64_t tick, const std::string& file) {
  Json json{{"done", done}, {"tick", tick}};
  if (!file.empty()) json["file"] = file;
  return json_text(json);
}

std::string clear_json(const v1::BenchDescription& bench, std::uint32_t axis, std::uint64_t cleared,
                       std::uint64_t tick) {
  return json_text(Json{
      {"axis", axis}, {"name", "clear"}, {"cleared", names_in(bench.faults(), cleared)}, {"tick", tick}});
}

}  // namespace drivebench::command
