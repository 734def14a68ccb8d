#include "server/config/sections/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "plant/parameters/drive_rows.hpp"
#include "server/config/sections/curves.hpp"
#include "server/config/sections/plausible.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

/// A section of the parameters, for example "machine", and the tables with its values.
struct Section {
  std::string_view name;
  StrictTable bench;
  std::optional<StrictTable> motor;  ///< values of the bench file have precedence
  bool optional = false;             ///< no key is required
  bool incomplete = false;  ///< a value is missing or wrong, so that rules between values cannot be checked
};

bool is_switch(const Parameter& row) noexcept {
  return row.integer && row.words.empty() && row.minimum == 0.0 && row.maximum == 1.0;
}

bool is_of_motor(std::string_view section) noexcept {
  return section == "machine" || section == "mechanics" || section == "thermal";
}

/// The index of the machine kind in machine_kinds(); nothing if the kind is unknown.
std::optional<std::size_t> read_kind(StrictTable& bench, StrictTable* motor, bool motor_missing) {
  const auto of_motor = motor != nullptr ? motor->choice("kind", machine_kinds()) : std::nullopt;
  const auto of_bench = bench.choice("kind", machine_kinds());
  if (of_motor && of_bench && *of_motor != *of_bench) {
    bench.report("kind", "is \"" + std::string(machine_kinds()[*of_bench]) + "\" but the motor file says \"" +
                             std::string(machine_kinds()[*of_motor]) + "\"");
    return std::nullopt;
  }
  if (of_bench || of_motor) return of_bench ? of_bench : of_motor;
  const bool is_told = bench.has("kind") || (motor != nullptr && motor->has("kind"));
  return is_told || motor_missing ? std::nullopt : std::optional<std::size_t>(0);
}

/// All sections except that of the machine.
class Sections {
 public:
  explicit Sections(const ParameterSource& source) : source_(source) {}

  Section& find(std::string_view name) {
    const auto found = std::find_if(sections_.begin(), sections_.end(),
                                    [&](const Section& section) { return section.name == name; });
    if (found != sections_.end()) return *found;
    const bool of_motor = is_of_motor(name);
    Section& section = sections_.emplace_back(Section{.name = name,
                                                      .bench = source_.axis.table(name),
                                                      .motor = std::nullopt,
                                                      .incomplete = of_motor && source_.motor_missing});
    if (of_motor && source_.motor.table) section.motor = source_.motor.table->table(name);
    return section;
  }
  std::vector<Section>& all() noexcept { return sections_; }

 private:
  const ParameterSource& source_;
  std::vector<Section> sections_;
};

/// Reads one row or curve. `read` reads it from a table and returns whether the value is valid.
template <class Read>
void read_entry(Section& section, std::string_view key, bool required, bool motor_missing, Read read) {
  bool present = false;
  const auto read_from = [&](StrictTable& table, bool of_bench) {
    const bool right = read(table, of_bench);
    present = present || table.has(key);
    section.incomplete = section.incomplete || (table.has(key) && !right);
  };
  if (section.motor) read_from(*section.motor, false);
  read_from(section.bench, true);
  if (present || !required || section.optional) return;
  const bool excused = section.incomplete && motor_missing;  // the unreadable motor file may have the value
  section.incomplete = true;
  if (!excused) (section.motor ? *section.motor : section.bench).require(key);
}

/// The table with this value; null if its section is incomplete.
StrictTable* table_of(std::vector<Section>& sections, std::string_view field) {
  const auto section = std::find_if(sections.begin(), sections.end(),
                                    [&](const Section& s) { return s.name == section_of(field); });
  if (section == sections.end() || section->incomplete) return nullptr;
  const std::string_view key = key_of(field);
  const bool in_motor = section->motor && section->motor->has(key) && !section->bench.has(key);
  return in_motor ? &*section->motor : &section->bench;
}

void report_rules(std::vector<Section>& sections, const AxisParameters& p, bool& right) {
  for (Problem& problem : problems(p)) {
    StrictTable* const table = table_of(sections, problem.field);
    if (table == nullptr) continue;
    right = false;
    table->report(key_of(problem.field), std::move(problem.rule));
  }
}

void report_oddities(std::vector<Section>& sections, const AxisParameters& p,
                     std::vector<ConfigProblem>& odd) {
  for (Problem& problem : oddities(p)) {
    const StrictTable* const table = table_of(sections, problem.field);
    if (table != nullptr) odd.push_back(table->problem(key_of(problem.field), std::move(problem.rule)));
  }
}

/// Takes the drive of the axis whose amplifier this one shares, without using the values of its sections.
void share_drive(Sections& sections, const ParameterSource& source, AxisParameters& p) {
  for (Section& section : sections.all()) {
    if (!is_section_of_drive(section.name)) continue;
    if (section.bench.exists()) {
      source.axis.report(section.name,
                         "cannot stand beside shares_amplifier_with: the drive is that of the other axis");
    }
    section.incomplete = true;  // the other axis reports broken rules
  }
  p.drive = *source.shared_drive;
}

/// Checks the mechanics of an axis that shares the shaft of another one, without using the values.
void share_mechanics(Section& section, const ParameterSource& source, AxisParameters& p) {
  if (section.bench.exists()) {
    source.axis.report("mechanics",
                       "cannot stand beside shares_shaft_with: the shaft is that of the other axis");
  }
  p.mechanics = {.inertia_kgm2 = source.shared_mechanics->inertia_kgm2};
  section.incomplete = true;  // the other axis reports broken rules
}

}  // namespace

bool read_parameters(const ParameterSource& source, ProblemList& problems, AxisParameters& p) {
  Sections sections(source);
  Section& machine = sections.find("machine");
  const auto kind = read_kind(machine.bench, machine.motor ? &*machine.motor : nullptr, source.motor_missing);
  if (kind) p.machine = make_machine(*kind);
  machine.incomplete = machine.incomplete || !kind;
  bool right = kind.has_value();
  const auto is_unknown = [&](std::string_view section) { return !kind && section == "machine"; };

  if (source.shared_mechanics != nullptr) sections.find("mechanics").optional = true;
  if (source.shared_drive != nullptr) {
    for (const Parameter& row : axis_parameters(p)) {
      if (is_of_drive(row.name)) sections.find(section_of(row.name)).optional = true;
    }
  }
  for (const Parameter& row : axis_parameters(p)) {
    if (is_unknown(section_of(row.name))) continue;
    read_entry(sections.find(section_of(row.name)), key_of(row.name), row.required, source.motor_missing,
               [&](StrictTable& table, bool) {
                 const std::optional<double> value = read_value(table, key_of(row.name), row);
                 if (value) row.set(p, *value);
                 return value.has_value();
               });
  }
  for (const CurveParameter& row : axis_curves(p)) {
    if (is_unknown(section_of(row.name))) continue;
    read_entry(sections.find(section_of(row.name)), key_of(row.name), row.required, source.motor_missing,
               [&](StrictTable& table, bool of_bench) {
                 std::optional<Curve> curve =
                     read_curve(table, row, of_bench ? source.folder : source.motor.folder, problems);
                 if (curve) row.set(p, std::move(*curve));
                 return curve.has_value();
               });
  }
  if (source.shared_drive != nullptr) share_drive(sections, source, p);
  if (source.shared_mechanics != nullptr) share_mechanics(sections.find("mechanics"), source, p);
  for (Section& section : sections.all()) {
    right = right && (!section.incomplete || section.optional);
    if (is_unknown(section.name)) continue;
    section.bench.finish();
    if (section.motor) section.motor->finish();
  }
  if (source.motor.table) source.motor.table->finish();
  report_rules(sections.all(), p, right);
  if (right) report_oddities(sections.all(), p, source.odd);
  return right;
}

std::optional<double> read_value(StrictTable& table, std::string_view key, const Parameter& row) {
  std::optional<double> value;
  if (!row.words.empty()) {
    if (const auto word = table.choice(key, row.words)) value = static_cast<double>(*word);
  } else if (is_switch(row)) {
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

bool is_section_of_drive(std::string_view section) noexcept {
  return std::ranges::any_of(axis_parameters(AxisParameters{}), [section](const Parameter& row) {
    return section_of(row.name) == section && is_of_drive(row.name);
  });
}

std::string value_text(const Parameter& row, double value) {
  if (!row.words.empty()) return in_quotes(row.words[static_cast<std::size_t>(value)]);
  if (!row.integer) return real_text(value);
  if (is_switch(row)) return value != 0.0 ? "true" : "false";
  return std::to_string(static_cast<std::int64_t>(value));
}

}  // namespace drivebench
