#include "plant/parameters/parameters.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <string>
#include <utility>

#include "plant/parameters/drive_rows.hpp"
#include "plant/parameters/later_rows.hpp"
#include "plant/parameters/machine_kind.hpp"
#include "plant/parameters/mechanics_rows.hpp"
#include "plant/parameters/rows.hpp"
#include "plant/parameters/sensor_rows.hpp"
#include "plant/parameters/transformer_rows.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kKinds = std::variant_size_v<MachineParameters>;

/// The whole tables of each kind, put together once.
struct Tables {
  std::array<std::string_view, kKinds> names;
  std::array<std::vector<Parameter>, kKinds> rows;
  std::array<std::vector<CurveParameter>, kKinds> curves;
};

Tables make_tables() {
  Tables tables;
  for (std::size_t k = 0; k < kKinds; ++k) {
    const MachineKind& kind = all_machine_kinds()[k];
    tables.names[k] = kind.name;
    for (const auto part :
         {kind.rows, mechanics_rows(), drive_rows(), sensor_rows(), transformer_rows(), later_rows()}) {
      tables.rows[k].insert(tables.rows[k].end(), part.begin(), part.end());
    }
    for (const auto part : {kind.curves, mechanics_curves(), drive_curves()}) {
      tables.curves[k].insert(tables.curves[k].end(), part.begin(), part.end());
    }
  }
  return tables;
}

const Tables& tables() noexcept {
  static const Tables all = make_tables();
  return all;
}

template <std::size_t kIndex = 0>
MachineParameters machine_of_kind(std::size_t kind) {
  if constexpr (kIndex + 1 < kKinds) {
    if (kind != kIndex) return machine_of_kind<kIndex + 1>(kind);
  }
  return MachineParameters(std::in_place_index<kIndex>);
}

void add_problem(const Parameter& row, double value, Problems& found) {
  if (!(value >= row.minimum && value <= row.maximum)) {
    found.add(row.name, [&] {
      return "is " + text(value) + " but must lie between " + text(row.minimum) + " and " +
             text(row.maximum) + (row.unit == "1" ? "" : " " + std::string(row.unit));
    });
  } else if (row.integer && value != std::trunc(value)) {
    found.add(row.name, [&] { return "is " + text(value) + " but must be a whole number"; });
  }
}

void add_curve_problems(const AxisParameters& p, Problems& found) {
  for (const CurveParameter& row : axis_curves(p)) {
    const Curve& curve = row.get(p);
    if (curve.empty()) {
      if (row.required) found.add(row.name, "is missing");
    } else if (const std::string rule = problem_with_points(curve.points(), row.rising); !rule.empty()) {
      found.add(row.name, rule);
    }
  }
}

/// The rules between values.
void add_rule_problems(const AxisParameters& p, Problems& found) {
  add_problems(p.machine, found);
  add_problems(p.mechanics, found);
  add_problems(p.drive, found);
  add_problems(p.encoder, found);
  add_problems(p.sensors, found);
  add_problems(p.thermal, found);
  add_later_problems(p, found);
}

}  // namespace

std::span<const std::string_view> machine_kinds() noexcept {
  return tables().names;
}

std::string_view machine_kind(const AxisParameters& p) noexcept {
  return tables().names[p.machine.index()];
}

MachineParameters make_machine(std::size_t kind) {
  return machine_of_kind(kind);
}

std::span<const Parameter> axis_parameters(const AxisParameters& p) noexcept {
  return tables().rows[p.machine.index()];
}

std::span<const CurveParameter> axis_curves(const AxisParameters& p) noexcept {
  return tables().curves[p.machine.index()];
}

const Parameter* find_parameter(const AxisParameters& p, std::string_view name) noexcept {
  for (const Parameter& row : axis_parameters(p)) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

std::string text(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

bool breaks_a_rule(const Parameter& parameter, double value) noexcept {
  Problems found;
  add_problem(parameter, value, found);
  return found.any();
}

bool breaks_a_rule(const AxisParameters& p) noexcept {
  Problems found;
  add_rule_problems(p, found);
  return found.any();
}

std::string problem_with(const Parameter& parameter, double value) {
  std::vector<Problem> sentences;
  Problems found(sentences);
  add_problem(parameter, value, found);
  return found.any() ? sentences.front().rule : std::string();
}

std::vector<Problem> problems(const AxisParameters& p) {
  std::vector<Problem> sentences;
  Problems found(sentences);
  for (const Parameter& row : axis_parameters(p))
    add_problem(row, row.get(p), found);
  add_curve_problems(p, found);
  add_rule_problems(p, found);
  return sentences;
}

}  // namespace drivebench
