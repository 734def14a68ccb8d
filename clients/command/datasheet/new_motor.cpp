#include "clients/command/datasheet/new_motor.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/datasheet/new_file.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

void add_missing(std::span<const Quantity> quantities, const Sheet& sheet, std::vector<Quantity>& missing) {
  std::ranges::copy_if(quantities, std::back_inserter(missing),
                       [&](const Quantity& q) { return q.required && !is_given(q, sheet); });
}

void fill_in(const MotorKind& kind, Sheet& sheet) {
  std::vector<Quantity> missing = kind.missing(sheet);
  for (const auto quantities : {kind.machine_values, kind.shaft_values, kind.other_values})
    add_missing(quantities, sheet, missing);
  complete(missing, sheet);
}

std::string lines_of(std::span<const Quantity> quantities, Sheet& sheet) {
  std::string text;
  for (const Quantity& quantity : quantities) {
    if (is_given(quantity, sheet)) text += text_of(line_of(quantity, sheet));
  }
  return text;
}

std::string machine_text(const MotorKind& kind, Sheet& sheet) {
  std::string text = fmt::format("\n[machine]\nkind = \"{}\"\n", kind.machine);
  if (kind.phases) text += "star = true\n";
  text += lines_of(kind.machine_values, sheet);
  for (const FileLine& line : kind.more_lines(sheet))
    text += text_of(line);
  return text;
}

std::string shaft_text(const MotorKind& kind, Sheet& sheet) {
  std::string text = "\n[mechanics]\n" + lines_of(kind.shaft_values, sheet);
  const double friction_nm = sheet.value("coulomb_friction_nm");
  if (friction_nm > 0.0) return text + fmt::format("static_friction_nm = {}\n", real(friction_nm));
  return text + "# No friction: --friction-nm or the no-load current would say more.\n";
}

/// The line that makes the file again.
std::string command_of(const MotorKind& kind, const NewMotorOptions& o, const Sheet::Numbers& given) {
  std::string text = fmt::format("drivebench new motor {}", kind.name);
  std::vector<std::string_view> told;  // a form may belong to two quantities
  for (const auto quantities : {kind.other_values, kind.machine_values, kind.shaft_values}) {
    for (const Quantity& quantity : quantities) {
      for (const Form& form : quantity.forms) {
        const auto x = given.find(form.name);
        if (x == given.end() || std::ranges::find(told, form.name) != told.end()) continue;
        told.push_back(form.name);
        text += " " + option_of(form, x->second);
      }
    }
  }
  return text + (o.sheet.delta ? " --delta" : "");
}

constexpr const char* kTwoPhases =
    "; three phases as their two-phase equivalent, power-invariant:\n"
    "# amplitudes times sqrt(3/2), so that power and torque need no factor";

}  // namespace

int run_new_motor(const MotorKind& kind, const NewMotorOptions& options) {
  check_new_file(options.out_file);
  check_text("--name", options.name);
  check_text("--source", options.source);
  Sheet sheet = options.sheet;
  fill_in(kind, sheet);
  const std::string made_by = command_of(kind, options, sheet.given);
  const std::string machine = machine_text(kind, sheet);
  const std::string shaft = shaft_text(kind, sheet);
  const std::vector<std::string> remarks = kind.check(sheet);

  const std::string name = options.name.empty() ? fmt::format("{} motor", kind.name) : options.name;
  std::string text = fmt::format(
      "# {}, as its data sheet has it. SI units{}.\n"
      "# Made by: {}\n",
      printable(name), kind.phases ? kTwoPhases : "", made_by);
  for (const std::string& remark : remarks) {
    text += fmt::format("# Note: {}.\n", remark);
    fmt::print(stderr, "note: {}\n", remark);
  }
  text += fmt::format("name = {}\nsource = {}\n", in_quotes(name), in_quotes(options.source));
  write_new_file(options.out_file, text + machine + shaft);
  if (!options.out_file.empty())
    fmt::print(stderr, "{0} is written; a bench for it: drivebench new bench {0} --help\n", options.out_file);
  return kExitOk;
}

}  // namespace drivebench::command
