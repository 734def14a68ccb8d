#include "clients/command/motor/motor_file.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "protocols/document.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

const ConfigNode* child_under(const ConfigNode* parent, std::string_view key) {
  if (parent == nullptr) return nullptr;
  const auto child = std::ranges::find(parent->children, key, &ConfigNode::key);
  return child == parent->children.end() ? nullptr : &*child;
}

std::string text_or(const ConfigNode* node, std::string text) {
  const auto* const found = node == nullptr ? nullptr : std::get_if<std::string>(&node->scalar);
  return found == nullptr ? text : *found;
}

std::optional<double> number_of(const ConfigNode& node) {
  if (const auto* const real = std::get_if<double>(&node.scalar)) return *real;
  if (const auto* const whole = std::get_if<std::int64_t>(&node.scalar)) return static_cast<double>(*whole);
  return std::nullopt;
}

/// The numbers of one table of the file.
struct Table {
  const ConfigNode* node;
  std::string name;
  const std::string& file;
  ProblemList& problems;

  double positive(std::string_view key) const { return number(key, std::nullopt, 0.0, false); }
  double not_negative(std::string_view key, double otherwise) const {
    return number(key, otherwise, 0.0, true);
  }

 private:
  double number(std::string_view key, std::optional<double> otherwise, double least, bool may_equal) const {
    const ConfigNode* const value = child_under(node, key);
    if (value == nullptr && otherwise) return *otherwise;
    const std::optional<double> found = value == nullptr ? std::nullopt : number_of(*value);
    if (found && std::isfinite(*found) && (*found > least || (may_equal && *found == least))) return *found;
    problems.add(file, value == nullptr ? 0 : value->line, fmt::format("{}.{}", name, key),
                 value == nullptr
                     ? "is missing"
                     : (may_equal ? "must be a number, 0 or above" : "must be a number above 0"));
    return 1.0;
  }
};

bool star_of(const ConfigNode* machine, bool otherwise) {
  const ConfigNode* const star = child_under(machine, "star");
  if (star == nullptr) return otherwise;
  if (const auto* const yes = std::get_if<bool>(&star->scalar)) return *yes;
  return number_of(*star).value_or(0.0) != 0.0;
}

/// A motor file that has a machine.
struct MotorDocument {
  std::string file;
  ConfigNode root;
  const ConfigNode& machine() const { return *child_under(&root, "machine"); }
  std::string name(const std::string& choice) const {
    return printable(text_or(child_under(&root, "name"), choice));
  }
  std::string kind() const { return text_or(child_under(&machine(), "kind"), "induction"); }
};

MotorDocument read_document(const std::string& choice) {
  const std::string file = find_motor_file(choice).string();
  const FileText text = read_file(file, kMaxConfigBytes);
  if (!text.why_not.empty()) throw UsageError(fmt::format("{}: the file {}", file, text.why_not));
  ProblemList problems;
  std::optional<ConfigNode> document = parse_document(text.text, file, problems);
  problems.throw_if_any();
  if (child_under(&*document, "machine") == nullptr)
    throw UsageError(fmt::format("{}: has no [machine]; a file of configs/motors has one", file));
  return {.file = file, .root = *std::move(document)};
}

}  // namespace

MotorFile read_motor_file(const std::string& choice) {
  const MotorDocument document = read_document(choice);
  const std::string kind = document.kind();
  return {.path = document.file,
          .name = document.name(choice),
          .kind = kind,
          .star = star_of(&document.machine(), kind == "bldc")};
}

InductionMotorFile read_induction_motor(const std::string& choice) {
  const MotorDocument document = read_document(choice);
  const std::string& file = document.file;
  const ConfigNode* const machine = &document.machine();
  if (const std::string kind = document.kind(); kind != "induction")
    throw UsageError(fmt::format("{}: machine.kind is {}; only induction machines have this circuit", file,
                                 printable(kind)));
  ProblemList problems;
  const Table values{machine, "machine", file, problems};
  const ConfigNode* const mechanics = child_under(&document.root, "mechanics");
  const Table shaft{mechanics, "mechanics", file, problems};
  InductionMotorFile found = {
      .name = document.name(choice),
      .motor = {.machine = {.pole_pairs = values.positive("pole_pairs"),
                            .mutual_inductance_h = values.positive("mutual_inductance_h"),
                            .rotor_resistance_ohm = values.positive("rotor_resistance_ohm"),
                            .rotor_inductance_h = values.positive("rotor_inductance_h"),
                            .friction_nms = shaft.not_negative("viscous_friction_nms", 0.0),
                            .inertia_kgm2 = shaft.not_negative("inertia_kgm2", 0.0)},
                .stator_resistance_ohm = values.positive("stator_resistance_ohm"),
                .stator_inductance_h = values.positive("stator_inductance_h")},
      .star = star_of(machine, false)};
  problems.throw_if_any();
  if (!(found.motor.leakage() > 0.0))
    throw UsageError(
        fmt::format("{}: machine.mutual_inductance_h makes the leakage factor {:.6g}; it must be "
                    "above 0: M^2 below L_R*L_S",
                    file, found.motor.leakage()));
  if (mechanics != nullptr) {
    for (const ConfigNode& each : mechanics->children) {
      if (each.key != "viscous_friction_nms" && each.key != "inertia_kgm2")
        found.left_out.push_back(printable(each.key));
    }
  }
  return found;
}

}  // namespace drivebench::command
