#include "server/config_axis.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "plant/parameters.hpp"
#include "server/config_words.hpp"

namespace drivebench {
namespace {

constexpr std::int64_t kMaxTicks = 1'000'000'000'000'000;
constexpr double kMaxSeconds = 1e9;
constexpr double kMaxLoadNm = 1e6;

std::string_view section_of(std::string_view row) {
  return row.substr(0, row.find('.'));
}

std::string_view key_of(std::string_view row) {
  return row.substr(row.find('.') + 1);
}

/// A section of the parameter table, for example "machine", and the tables that give its values.
struct Section {
  std::string_view name;
  StrictTable bench;
  std::optional<StrictTable> motor;  ///< the bench's values have precedence
  bool incomplete = false;           ///< a value is missing or wrong: no rule between values can be checked
};

/// The motor file of an axis: must outlive the sections that read it.
struct MotorFile {
  std::string path;
  std::optional<ConfigNode> document;
  std::optional<StrictTable> table;
  std::string name;
};

void read_motor_file(StrictTable& axis, const std::string& motor, const std::filesystem::path& folder,
                     ProblemList& problems, MotorFile& result) {
  if (folder.empty()) {
    axis.report("motor", std::string(kNoOtherFiles));
    return;
  }
  result.path = (folder / motor).lexically_normal().string();
  const FileText file = read_file(result.path, kMaxConfigBytes);
  if (!file.why_not.empty()) {
    axis.report("motor", "names " + result.path + ", which " + file.why_not);
    return;
  }
  result.document = parse_document(file.text, result.path, problems);
  if (!result.document) return;
  StrictTable& table = result.table.emplace(&*result.document, "", 1, result.path, problems);
  table.require("name");
  table.require("source");
  result.name = table.text("name", 200).value_or("");
  table.text("source", 800);
}

std::vector<Section> sections_of(StrictTable& axis, MotorFile& motor, bool motor_missing) {
  std::vector<Section> sections;
  for (const Parameter& row : axis_parameters()) {
    const std::string_view name = section_of(row.name);
    if (!sections.empty() && sections.back().name == name) continue;
    const bool of_motor = name == "machine" || name == "mechanics";
    sections.push_back({name, axis.table(name), std::nullopt, of_motor && motor_missing});
    if (of_motor && motor.table) sections.back().motor = motor.table->table(name);
  }
  return sections;
}

/// The value of a parameter if the table has it and it is right by itself.
std::optional<double> read_value(StrictTable& table, const Parameter& row) {
  const std::string_view key = key_of(row.name);
  std::optional<double> value;
  if (row.integer && row.minimum == 0.0 && row.maximum == 1.0) {
    if (const auto boolean = table.boolean(key)) value = *boolean ? 1.0 : 0.0;
  } else if (row.integer) {
    const auto integer = table.integer(key, std::llround(row.minimum), std::llround(row.maximum));
    if (integer) value = static_cast<double>(*integer);
  } else {
    value = table.real(key);
  }
  if (!value) return std::nullopt;
  if (std::string rule = problem_with(row, *value); !rule.empty()) {
    table.report(key, std::move(rule));
    return std::nullopt;
  }
  return value;
}

void read_parameter(Section& section, const Parameter& row, bool motor_missing, AxisParameters& p) {
  const std::string_view key = key_of(row.name);
  bool present = false;
  const auto read_from = [&](StrictTable& table) {
    const std::optional<double> value = read_value(table, row);
    if (value) row.set(p, *value);
    present = present || table.has(key);
    section.incomplete = section.incomplete || (table.has(key) && !value);
  };
  if (section.motor) read_from(*section.motor);
  read_from(section.bench);
  if (present || !row.required) return;
  const bool excused = section.incomplete && motor_missing;  // the motor file may have had it
  section.incomplete = true;
  if (!excused) (section.motor ? *section.motor : section.bench).require(key);
}

void report_rules(std::vector<Section>& sections, const AxisParameters& p) {
  for (Problem& problem : problems(p)) {
    const auto section = std::find_if(sections.begin(), sections.end(),
                                      [&](const Section& s) { return s.name == section_of(problem.field); });
    if (section == sections.end() || section->incomplete) continue;
    const std::string_view key = key_of(problem.field);
    const bool in_motor = section->motor && section->motor->has(key) && !section->bench.has(key);
    (in_motor ? *section->motor : section->bench).report(key, std::move(problem.rule));
  }
}

bool read_parameters(StrictTable& axis, MotorFile& motor, bool motor_missing, AxisParameters& p) {
  std::vector<Section> sections = sections_of(axis, motor, motor_missing);
  for (const Parameter& row : axis_parameters()) {
    const auto section = std::find_if(sections.begin(), sections.end(),
                                      [&](const Section& s) { return s.name == section_of(row.name); });
    read_parameter(*section, row, motor_missing, p);
  }
  for (Section& section : sections) {
    section.bench.finish();
    if (section.motor) section.motor->finish();
  }
  if (motor.table) motor.table->finish();
  report_rules(sections, p);
  return !sections.front().incomplete && leakage_factor(p.machine) > 0.0;
}

std::vector<LoadEvent> read_loads(StrictTable& axis, std::int64_t period_ns) {
  std::vector<LoadEvent> loads;
  for (StrictTable& table : axis.tables("load", kMaxLoads)) {
    const auto tick = read_ticks(table, "at_s", "at_tick", period_ns);
    const auto load_nm = table.real("load_nm", -kMaxLoadNm, kMaxLoadNm);
    const auto ramp = read_ticks(table, "ramp_s", "ramp_ticks", period_ns);
    if (!table.has("at_tick")) table.require("at_s");
    table.require("load_nm");
    table.finish();
    loads.push_back({tick.value_or(0), {.load_nm = load_nm.value_or(0.0), .ramp_ticks = ramp.value_or(0)}});
  }
  std::stable_sort(loads.begin(), loads.end(), [](const auto& x, const auto& y) { return x.tick < y.tick; });
  return loads;
}

}  // namespace

std::optional<Tick> read_ticks(StrictTable& table, std::string_view seconds_key, std::string_view ticks_key,
                               std::int64_t period_ns) {
  const auto seconds = table.real(seconds_key, 0.0, kMaxSeconds);
  const auto ticks = table.integer(ticks_key, 0, kMaxTicks);
  if (table.has(seconds_key) && table.has(ticks_key)) {
    table.report(ticks_key, "cannot stand beside " + std::string(seconds_key));
  }
  if (!seconds) return ticks;
  return std::llround(*seconds * 1e9 / static_cast<double>(period_ns));
}

AxisReading read_axis(StrictTable& axis, const std::filesystem::path& folder, std::int64_t period_ns,
                      std::uint32_t default_node, ProblemList& problems) {
  AxisReading result;
  axis.require("name");
  result.config.name = axis.identifier("name").value_or("");

  MotorFile motor;
  const auto motor_path = axis.text("motor", 800);
  motor.name = axis.text("motor_name", 200).value_or("");
  if (axis.has("motor") && axis.has("motor_name")) {
    axis.report("motor_name", "cannot stand beside motor: the motor file has a name");
  }
  if (motor_path) read_motor_file(axis, *motor_path, folder, problems, motor);
  result.machine_valid =
      read_parameters(axis, motor, axis.has("motor") && !motor.table, result.setup.parameters);
  result.config.motor = motor.name;

  const auto action = axis.choice("on_link_loss", kSafeActionWords);
  result.setup.on_link_loss = static_cast<SafeAction>(action.value_or(0));
  const auto node = axis.integer("can_node", 1, can::kMaxNode);
  result.config.can_node = static_cast<std::uint32_t>(node.value_or(default_node));
  result.config.loads = read_loads(axis, period_ns);
  axis.finish();
  return result;
}

}  // namespace drivebench
