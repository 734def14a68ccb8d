#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "protocols/document.hpp"
#include "protocols/text.hpp"
#include "server/bench/terminals.hpp"
#include "server/config/config.hpp"
#include "server/config/experiment_limits.hpp"
#include "server/config/sections/axis.hpp"
#include "server/config/sections/can.hpp"
#include "server/config/sections/plausible.hpp"
#include "server/config/sections/service.hpp"
#include "server/config/sections/step.hpp"
#include "server/config/strict_table.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

constexpr std::int64_t kMaxSeed = INT64_MAX;  // the largest integer of TOML
constexpr double kDefaultLeaseS = 2.0;
constexpr double kLongestLeaseS = 1e9;  // its nanoseconds can be added to those of the clock
constexpr std::int64_t kMaxArmingCommands = 1000;
constexpr int kLastCpu = 1023;

/// Reads a duration in units of `ns_per_unit`; it must be a whole number of nanoseconds.
std::optional<std::int64_t> read_ns(StrictTable& table, std::string_view key, double ns_per_unit,
                                    double minimum, double maximum) {
  const auto value = table.real(key, minimum, maximum);
  if (!value) return std::nullopt;
  const double ns = *value * ns_per_unit;
  const double whole = std::round(ns);
  if (std::abs(ns - whole) > 1e-6 + 1e-15 * ns) {
    table.report(key, "is " + shortest(*value) + " but must be whole nanoseconds; the nearest is " +
                          shortest(whole / ns_per_unit));
    return std::nullopt;
  }
  return static_cast<std::int64_t>(whole);
}

void read_lease(StrictTable& bench, bool period_valid, BenchSetup& setup) {
  const auto ticks = read_ticks(bench, "lease_s", "lease_ticks", setup.period_ns);
  if (ticks) {
    setup.lease_ticks = *ticks;
  } else {
    const Tick default_ticks = std::llround(kDefaultLeaseS * 1e9 / static_cast<double>(setup.period_ns));
    setup.lease_ticks = std::max(default_ticks, setup.watchdog_ticks);
  }
  if (period_valid && setup.lease_ticks < setup.watchdog_ticks) {
    bench.report(
        bench.has("lease_s") ? "lease_s" : "lease_ticks",
        "comes to " + std::to_string(setup.lease_ticks) +
            " ticks but must not be shorter than watchdog_ticks = " + std::to_string(setup.watchdog_ticks));
  }
  const Tick longest = std::llround(kLongestLeaseS * 1e9 / static_cast<double>(setup.period_ns));
  if (period_valid && setup.lease_ticks > longest) {
    bench.report("lease_ticks", "comes to " + std::to_string(setup.lease_ticks) +
                                    " ticks but must not be longer than " + shortest(kLongestLeaseS) +
                                    " s, " + std::to_string(longest) + " ticks");
  }
}

/// Reads [bench]; false if the period or the substeps are wrong.
bool read_bench(StrictTable& bench, BenchConfig& config) {
  for (const std::string_view key : {"name", "mode", "period_us"})
    bench.require(key);
  config.name = bench.identifier("name").value_or("");
  const auto mode = bench.choice("mode", kRunModeWords);
  config.mode = static_cast<RunMode>(mode.value_or(static_cast<std::size_t>(config.mode)));

  BenchSetup& setup = config.setup;
  const auto period_ns = read_ns(bench, "period_us", 1e3, 1.0, 1e6);
  setup.period_ns = period_ns.value_or(setup.period_ns);
  const auto substeps = bench.integer("substeps", 1, kMaxSubsteps);
  setup.substeps = static_cast<int>(substeps.value_or(setup.substeps));
  setup.seed = static_cast<std::uint64_t>(
      bench.integer("seed", 0, kMaxSeed).value_or(static_cast<std::int64_t>(setup.seed)));
  setup.watchdog_ticks = bench.integer("watchdog_ticks", 1, 1'000'000).value_or(setup.watchdog_ticks);
  read_lease(bench, period_ns.has_value(), setup);

  const bool realtime = config.mode == RunMode::kRealtime;
  setup.command_delay_ticks =
      static_cast<int>(bench.integer("command_delay_ticks", 0, 1).value_or(realtime ? 1 : 0));
  setup.arming_commands =
      bench.integer("arming_commands", 1, kMaxArmingCommands).value_or(default_arming_commands(config.mode));
  if (mode && realtime && setup.command_delay_ticks == 0) {
    bench.report(
        "command_delay_ticks",
        "is 0 but must be 1 in real time: tick k starts before any answer to sample k can have come");
  }
  bench.finish();
  return period_ns && (substeps || !bench.has("substeps"));
}

void read_realtime(StrictTable table, RealtimeConfig& realtime) {
  const auto pacer = table.choice("pacer", kPacerWords);
  realtime.pacer = static_cast<PacerKind>(pacer.value_or(static_cast<std::size_t>(realtime.pacer)));
  realtime.max_lateness_ns =
      read_ns(table, "max_lateness_ms", 1e6, 1e-3, 1e6).value_or(realtime.max_lateness_ns);
  realtime.cpu = static_cast<int>(table.integer("cpu", -1, kLastCpu).value_or(realtime.cpu));
  realtime.priority = static_cast<int>(table.integer("priority", 0, 99).value_or(realtime.priority));
  table.finish();
}

void read_modbus(StrictTable table, ModbusConfig& modbus) {
  modbus.enabled = table.exists();
  modbus.address = table.address("address").value_or(modbus.address);
  modbus.port = static_cast<std::uint16_t>(table.integer("port", 0, 65535).value_or(modbus.port));
  modbus.allow_writes = table.boolean("allow_writes").value_or(modbus.allow_writes);
  modbus.unprotected = table.boolean("unprotected").value_or(modbus.unprotected);
  if (modbus.allow_writes && !is_loopback(modbus.address) && !modbus.unprotected) {
    table.report("allow_writes", "is true at " + modbus.address +
                                     ", which other computers can reach, and Modbus knows no password: "
                                     "unprotected = true lets them");
  }
  modbus.max_connections =
      static_cast<std::uint32_t>(table.integer("max_connections", 1, 1024).value_or(modbus.max_connections));
  modbus.requests_per_s = static_cast<std::uint32_t>(
      table.integer("requests_per_s", 0, 1'000'000).value_or(modbus.requests_per_s));
  modbus.frame_timeout_ms = table.integer("frame_timeout_ms", 10, 60'000).value_or(modbus.frame_timeout_ms);
  modbus.idle_timeout_ms = table.integer("idle_timeout_ms", 100, 86'400'000).value_or(modbus.idle_timeout_ms);
  table.finish();
}

void read_experiments(StrictTable table, const std::filesystem::path& folder,
                      ExperimentsConfig& experiments) {
  if (table.exists()) table.require("folder");
  if (const auto name = table.text("folder", 800)) {
    if (folder.empty()) {
      table.report("folder", std::string(kNoOtherFiles));
    } else {
      experiments.folder = (folder / *name).lexically_normal();
    }
  }
  experiments.queue_length = static_cast<std::uint32_t>(
      table.integer("queue_length", 1, kMaxQueuedExperiments).value_or(experiments.queue_length));
  experiments.longest_s = table.real("longest_s", 1e-6, 86'400.0).value_or(experiments.longest_s);
  experiments.table_rows =
      static_cast<std::uint64_t>(table.integer("table_rows", 0, 100'000'000)
                                     .value_or(static_cast<std::int64_t>(experiments.table_rows)));
  experiments.kept =
      static_cast<std::uint32_t>(table.integer("kept", 1, kMaxKeptExperiments).value_or(experiments.kept));
  table.finish();
}

/// The name of an axis that is yet to be read; empty without one.
std::string name_in(StrictTable& axis) {
  const ConfigNode* const node = axis.node("name");
  const auto* const name = node != nullptr ? std::get_if<std::string>(&node->scalar) : nullptr;
  return name != nullptr ? *name : std::string();
}

std::vector<AxisReading> read_axes(StrictTable& root, const std::filesystem::path& folder,
                                   ProblemList& problems, std::vector<ConfigProblem>& odd,
                                   const BenchConfig& config) {
  root.require("axis");
  std::vector<AxisReading> axes;
  std::size_t events = 0;
  std::size_t points = 0;
  std::vector<StrictTable> tables = root.tables("axis", kMaxAxes);
  std::vector<std::string> names;
  names.reserve(tables.size());
  for (StrictTable& table : tables)
    names.push_back(name_in(table));
  for (StrictTable& table : tables) {
    AxisReading axis = read_axis(table, folder, config.setup.period_ns, names, axes, problems, odd);
    const std::string& name = axis.config.name;
    const std::uint32_t node = axis.config.can_node;
    const auto another = [&](auto same) { return std::any_of(axes.begin(), axes.end(), same); };
    if (!name.empty() && another([&](const AxisReading& other) { return other.config.name == name; })) {
      table.report("name", "is \"" + name + "\", the name of another axis");
    }
    if (another([&](const AxisReading& other) { return other.config.can_node == node; })) {
      table.report("can_node", "is " + std::to_string(node) + ", the node of another axis");
    }
    events += axis.config.events.size();
    if (events > kMaxAxisEvents) {
      table.report("name", "has events that bring those of all axes to " + std::to_string(events) +
                               " but there may be " + std::to_string(kMaxAxisEvents));
    }
    for (const CurveParameter& row : axis_curves(axis.setup.parameters))
      points += row.get(axis.setup.parameters).points().size();
    if (points > kMaxCurvePoints) {
      table.report("name", "has curves that bring the points of all axes to " + std::to_string(points) +
                               " but there may be " + std::to_string(kMaxCurvePoints));
    }
    axes.push_back(std::move(axis));
  }
  return axes;
}

/// Reports implausible values together with problems, since they may be the cause.
void throw_if_any(ProblemList& problems, const std::vector<ConfigProblem>& odd) {
  try {
    problems.throw_if_any();
  } catch (const ConfigError& error) {
    std::vector<ConfigProblem> all = error.problems();
    all.insert(all.end(), odd.begin(), odd.end());
    throw ConfigError(std::move(all));
  }
}

BenchConfig parse(std::string_view text, const std::string& name, const std::filesystem::path& folder,
                  std::vector<ConfigProblem>* odd_values) {
  std::vector<ConfigProblem> odd;
  ProblemList problems;
  BenchConfig config;
  const std::size_t limit = folder.empty() ? kMaxRecordedConfigBytes : kMaxConfigBytes;
  if (const auto document = parse_document(text, name, problems, limit)) {
    StrictTable root(&*document, "", 1, name, problems);
    root.require("bench");
    StrictTable bench = root.table("bench");
    const bool timing_valid = bench.exists() && read_bench(bench, config);
    read_realtime(root.table("realtime"), config.realtime);
    read_tcp(root.table("tcp"), folder, config.tcp);
    read_tls(root.table("tls"), folder, config.tls);
    const std::vector<AxisReading> axes = read_axes(root, folder, problems, odd, config);
    if (!bench.has("substeps")) config.setup.substeps = automatic_substeps(axes, config.setup.period_ns);
    for (const AxisReading& axis : axes) {
      if (timing_valid && axis.parameters_valid) check_step(bench, config.setup, axis);
      config.setup.axes.push_back(axis.setup);
      config.axes.push_back(axis.config);
    }
    const bool wide = std::any_of(axes.begin(), axes.end(), [](const AxisReading& axis) {
      return terminals_of(axis.setup.parameters).is_wide();
    });
    std::vector<std::uint32_t> nodes;
    nodes.reserve(axes.size());
    for (const AxisReading& axis : axes)
      nodes.push_back(axis.config.can_node);
    config.can = read_can(root, nodes, wide);
    read_modbus(root.table("modbus"), config.modbus);
    read_experiments(root.table("experiments"), folder, config.experiments);
    read_audit(root.table("audit"), folder, config.audit);
    config.log_level = read_log_level(root.table("log"));
    root.finish();
  }
  if (odd_values == nullptr) odd.clear();
  throw_if_any(problems, odd);
  if (odd_values != nullptr) *odd_values = std::move(odd);
  return config;
}

BenchConfig load(const std::filesystem::path& file, std::vector<ConfigProblem>* odd) {
  const FileText read = read_file(file, kMaxConfigBytes);
  if (!read.why_not.empty()) throw ConfigError({{file.string(), 0, {}, read.why_not}});
  return parse(read.text, file.string(), std::filesystem::absolute(file).parent_path(), odd);
}

}  // namespace

BenchConfig parse_config(std::string_view text, const std::string& name,
                         const std::filesystem::path& folder) {
  return parse(text, name, folder, nullptr);
}

BenchConfig load_config(const std::filesystem::path& file) {
  return load(file, nullptr);
}

BenchConfig load_config(const std::filesystem::path& file, std::vector<ConfigProblem>& odd) {
  return load(file, &odd);
}

}  // namespace drivebench
