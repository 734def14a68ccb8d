#include "clients/web/gateway/reports/reports.hpp"

#include <fmt/core.h>

#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <utility>

#include "clients/link/tcp/mode_name.hpp"
#include "protocols/json.hpp"
#include "protocols/resident_memory.hpp"
#include "protocols/text.hpp"

namespace drivebench::web {
namespace {

using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

/// A text in the format of Prometheus: each family once, with its help and type, then its values.
class Exposition {
 public:
  void family(std::string_view name, std::string_view type, std::string_view help) {
    name_ = name;
    text_ += fmt::format("# HELP {} {}\n# TYPE {} {}\n", name, help, name, type);
  }
  void value(double value, Labels labels = {}) { line("", number(value), labels); }
  void value(std::uint64_t value, Labels labels = {}) { line("", fmt::format("{}", value), labels); }

  template <class Value>
  void single(std::string_view name, std::string_view type, std::string_view help, Value only) {
    family(name, type, help);
    value(only);
  }

  /// Counts of times as Status has them: entry n below 125 ns times 2^n and in no earlier one.
  void histogram(std::string_view name, std::string_view help,
                 const google::protobuf::RepeatedField<std::uint64_t>& counts, double sum_s) {
    family(name, "histogram", help);
    std::uint64_t below = 0;
    double edge_s = kFirstEdgeS;
    for (int n = 0; n < counts.size(); ++n, edge_s *= 2.0) {
      below += counts[n];
      const bool is_last = n + 1 == counts.size();
      line("_bucket", fmt::format("{}", below), {{"le", is_last ? "+Inf" : number(edge_s)}});
    }
    line("_sum", number(sum_s), {});
    line("_count", fmt::format("{}", below), {});
  }

  std::string take() { return std::move(text_); }

 private:
  static std::string number(double value) {
    if (std::isnan(value)) return "NaN";
    if (std::isinf(value)) return value > 0.0 ? "+Inf" : "-Inf";
    return shortest(value);
  }
  static std::string escaped(std::string_view text) {
    std::string out;
    for (const char c : utf8(text)) {
      if (c == '\\' || c == '"') out += '\\';
      if (c == '\n') {
        out += "\\n";
      } else {
        out += c;
      }
    }
    return out;
  }
  void line(std::string_view suffix, const std::string& value, Labels labels) {
    text_ += name_;
    text_ += suffix;
    char separator = '{';
    for (const auto& [label, of] : labels) {
      text_ += fmt::format("{}{}=\"{}\"", separator, label, escaped(of));
      separator = ',';
    }
    if (labels.size() != 0) text_ += '}';
    text_ += ' ' + value + '\n';
  }

  static constexpr double kFirstEdgeS = 125e-9;

  std::string text_;
  std::string name_;
};

constexpr std::string_view kCounter = "counter";
constexpr std::string_view kGauge = "gauge";

void add_gateway(Exposition& out, const GatewayCounts& counts) {
  out.single("drivebench_web_connections", kGauge, "Connections to the gateway that are open.",
             counts.connections);
  out.single("drivebench_web_browsers", kGauge, "WebSockets that are open, each a session with the bench.",
             counts.browsers);
  out.single("drivebench_web_requests_total", kCounter, "HTTP requests.", counts.requests);
  out.family("drivebench_web_refusals_total", kCounter, "Requests and connections that the gateway refused.");
  for (const auto& [reason, count] : counts.refusals)
    out.value(count, {{"reason", reason}});
  out.single("drivebench_web_sent_bytes_total", kCounter, "Bytes from the bench to browsers.",
             counts.bytes_to_browsers);
  out.single("drivebench_web_received_bytes_total", kCounter, "Bytes from browsers to the bench.",
             counts.bytes_to_bench);
  out.single("process_resident_memory_bytes", kGauge, "Resident memory of the gateway.", resident_bytes());
}

void add_bench(Exposition& out, const Reading& reading) {
  const v1::Status& status = reading.status;
  out.family("drivebench_info", kGauge, "The bench: its name, mode and build.");
  out.value(
      std::uint64_t{1},
      {{"bench", reading.bench.name()}, {"mode", link::name_of(status.mode())}, {"build", reading.build_id}});
  out.single("drivebench_period_seconds", kGauge, "Sample period.", reading.bench.period_s());
  out.single("drivebench_ticks_total", kCounter, "Ticks since the start.", status.tick());
  out.single("drivebench_late_ticks_total", kCounter, "Ticks that started after their time.",
             status.late_ticks());
  out.single("drivebench_worst_lateness_seconds", kGauge, "The worst lateness of a tick.",
             status.worst_lateness_s());
  if (!status.lateness_counts().empty()) {
    out.histogram("drivebench_tick_lateness_seconds", "Time from when a tick was due to its start.",
                  status.lateness_counts(), status.lateness_sum_s());
  }
  out.histogram(
      "drivebench_exchange_seconds",
      "Time in the server from the arrival of commands to the answer with the samples of their tick.",
      status.exchange_counts(), status.exchange_sum_s());
  out.single("drivebench_resident_memory_bytes", kGauge, "Resident memory of the server.",
             status.resident_bytes());
  out.single("drivebench_sessions", kGauge, "Sessions of the server, with that of the gateway.",
             std::uint64_t{status.sessions()});
  out.single("drivebench_recording", kGauge, "1: the server writes a recording.",
             std::uint64_t{!status.recording().empty() && !status.recording_over()});
  out.single("drivebench_recording_gaps_total", kCounter, "Samples or inputs that the recorder lost.",
             status.recording_gaps());
}

/// A family with a value for each axis; `get` reads it from the newest sample.
template <class Get>
void add_of_axes(Exposition& out, const Reading& reading, std::string_view name, std::string_view type,
                 std::string_view help, Get get) {
  out.family(name, type, help);
  for (const v1::AxisSample& each : reading.status.axes()) {
    if (each.axis() >= static_cast<std::uint32_t>(reading.bench.axes_size())) continue;
    out.value(get(each.sample()), {{"axis", reading.bench.axes(static_cast<int>(each.axis())).name()}});
  }
}

void add_axes(Exposition& out, const Reading& reading) {
  using S = v1::Sample;
  add_of_axes(out, reading, "drivebench_axis_state", kGauge,
              "State: 0 idle, 1 run, 2 hold, 3 timeout, 4 fault, 5 ready.",
              [](const S& s) { return s.state(); });
  add_of_axes(out, reading, "drivebench_axis_owned", kGauge, "1: a controller holds the lease.",
              [](const S& s) { return std::uint64_t{s.owner() != 0}; });
  add_of_axes(out, reading, "drivebench_axis_missed_commands_total", kCounter,
              "Ticks for which a controller owed a command.", [](const S& s) { return s.missed_commands(); });
  add_of_axes(out, reading, "drivebench_axis_refused_commands_total", kCounter,
              "Refused commands of the controller.", [](const S& s) { return s.refused_commands(); });
  add_of_axes(out, reading, "drivebench_axis_speed_radians_per_second", kGauge, "True speed of the shaft.",
              [](const S& s) { return s.speed_rad_s(); });
  out.family("drivebench_axis_fault", kGauge, "1: the fault is present or latched.");
  for (const v1::AxisSample& each : reading.status.axes()) {
    if (each.axis() >= static_cast<std::uint32_t>(reading.bench.axes_size())) continue;
    for (const v1::FaultDescription& fault : reading.bench.faults()) {
      out.value(
          std::uint64_t{(each.sample().faults() & fault.bit()) != 0},
          {{"axis", reading.bench.axes(static_cast<int>(each.axis())).name()}, {"fault", fault.name()}});
    }
  }
}

void add_transports(Exposition& out, const v1::Status& status) {
  out.family("drivebench_transport_up", kGauge, "1: the transport works.");
  for (const v1::TransportStatus& each : status.transports())
    out.value(std::uint64_t{each.state() == "up"}, {{"transport", each.name()}});
  out.family("drivebench_transport_events_total", kCounter, "What the transport counted.");
  for (const v1::TransportStatus& each : status.transports()) {
    for (const v1::TransportStatus::Count& count : each.counts())
      out.value(count.value(), {{"transport", each.name()}, {"event", count.name()}});
  }
}

}  // namespace

std::string metrics_text(const Reading& reading, const GatewayCounts& counts) {
  Exposition out;
  out.single("drivebench_up", kGauge, "1: the bench answers the gateway.",
             std::uint64_t{reading.problem.empty()});
  add_gateway(out, counts);
  if (reading.problem.empty()) {
    add_bench(out, reading);
    add_axes(out, reading);
    add_transports(out, reading.status);
  }
  return out.take();
}

std::string health_json(const Reading& reading) {
  nlohmann::ordered_json health;
  if (reading.problem.empty()) {
    health = {{"status", "ok"},
              {"bench", utf8(reading.bench.name())},
              {"mode", link::name_of(reading.status.mode())},
              {"tick", reading.status.tick()},
              {"late_ticks", reading.status.late_ticks()}};
  } else {
    health = {{"status", "no bench"}, {"problem", utf8(reading.problem)}};
  }
  return json_text(health) + "\n";
}

}  // namespace drivebench::web
