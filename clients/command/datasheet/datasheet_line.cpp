#include "clients/command/datasheet/datasheet_line.hpp"

#include <fmt/core.h>

#include <cctype>

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/datasheet/new_bench.hpp"
#include "clients/command/datasheet/new_case.hpp"
#include "clients/command/datasheet/new_motor.hpp"

namespace drivebench::command {
namespace {

/// Where the options of a quantity stand: in a group of its own if there are several.
std::string group_of(const Quantity& quantity) {
  if (quantity.forms.size() > 1) {
    const char first = static_cast<char>(std::toupper(static_cast<unsigned char>(quantity.title.front())));
    return fmt::format("{}{}, in one of these forms{}", first, quantity.title.substr(1),
                       quantity.required ? "" : " (may be left out)");
  }
  return quantity.required ? "Numbers that must be known" : "Numbers that may be left out";
}

/// An option for each form of a quantity.
void add_forms(CLI::App& sub, std::span<const Quantity> quantities, Sheet& sheet) {
  for (const Quantity& quantity : quantities) {
    const bool choice = quantity.forms.size() > 1;
    for (const Form& form : quantity.forms) {
      if (sub.get_option_no_throw(fmt::format("--{}", form.name)) != nullptr) continue;  // of two quantities
      sub.add_option_function<double>(
             fmt::format("--{}", form.name),
             [&sheet, name = std::string(form.name)](double x) { sheet.given[name] = x; },
             choice ? std::string(form.meaning) : fmt::format("{}, {}", quantity.title, form.meaning))
          ->type_name(std::string(form.unit))
          ->check(finite_between(form.least, form.most))
          ->group(group_of(quantity));
    }
  }
}

void add_out(CLI::App& sub, std::string& out_file) {
  sub.add_option("--out", out_file, "write to this file, which must be new; default: standard output")
      ->type_name("FILE.toml")
      ->group(kOutput);
}

void add_new_motor(CommandLine& line, CLI::App& parent, const MotorKind& kind) {
  const auto [sub, o] = line.add<NewMotorOptions>(
      parent, std::string(kind.name), std::string(kind.title),
      [&kind](const NewMotorOptions& options) { return run_new_motor(kind, options); });
  for (const auto quantities : {kind.machine_values, kind.shaft_values, kind.other_values})
    add_forms(sub, quantities, o.sheet);
  if (kind.phases) {
    sub.add_flag("--delta", o.sheet.delta, "phase numbers are those of the phases of a delta")
        ->group("What the numbers mean");
  }
  begin_group(sub, kOutput);
  sub.add_option("--name", o.name, "name of the motor, for people")->type_name("NAME");
  sub.add_option("--source", o.source, "where its numbers are from")
      ->type_name("SOURCE")
      ->capture_default_str();
  add_out(sub, o.out_file);
  sub.footer(fmt::format(
      "Example:\n  drivebench new motor {0} {1} --out my-{0}.toml\n"
      "What is missing is asked for on a terminal. Give a quantity in several forms, and they must "
      "agree within a tenth.\n"
      "Exit codes: 0 written, 2 a number is missing, impossible or contradicts another.",
      kind.name, kind.example));
}

void add_new_bench(CommandLine& line, CLI::App& parent) {
  const auto [sub, o] =
      line.add<NewBenchOptions>(parent, "bench", "make a bench file for a motor file", run_new_bench);
  sub.add_option("MOTOR", o.motor, "a motor file, or the name of one of configs/motors")
      ->type_name("MOTOR")
      ->required();
  add_forms(sub, bench_quantities(), o.sheet);
  begin_group(sub, "Time");
  sub.add_option("--mode", o.mode, "lockstep: time waits for the controller; realtime: it does not")
      ->check(CLI::IsMember({"lockstep", "realtime"}))
      ->type_name("MODE")
      ->capture_default_str();
  sub.add_option("--period-us", o.period_us, "period of a tick, the controller's sample period")
      ->check(finite_between(1.0, 1e6))
      ->type_name("MICROSECONDS")
      ->capture_default_str();
  add_out(sub, o.out_file);
  sub.footer(
      "Example:\n  drivebench new bench my-dc.toml --bus-v 24 --max-current-a 10 --lines 500 --out "
      "bench.toml\n"
      "What is missing is asked for on a terminal; the server checks the file.\n"
      "Exit codes: 0 written and accepted, 2 a number is missing or the server does not accept the file.");
}

void add_new_case(CommandLine& line, CLI::App& parent) {
  const auto [sub, o] = line.add<NewCaseOptions>(
      parent, "case", "make a case of a regression suite for a program of yours", run_new_case);
  sub.add_option("BENCH", o.bench, "a bench file, or the name of one of configs/benches")
      ->type_name("BENCH")
      ->required();
  begin_group(sub, kWhat);
  sub.add_option("--command", o.command, "your program and its arguments, in quotes")
      ->type_name("COMMAND")
      ->required();
  sub.add_option("--speed-rad-s", o.speed_rad_s, "speed to which it brings the motor")
      ->type_name("RAD/S")
      ->check(finite_between(-1e6, 1e6))
      ->required();
  sub.add_option("--load-nm", o.load_nm, "load that comes in the middle; default: none")
      ->type_name("NM")
      ->check(finite_between(-1e6, 1e6));
  sub.add_option("--duration-s", o.duration_s, "length of the run in the bench's time")
      ->type_name("SECONDS")
      ->check(finite_between(1e-3, 1e6))
      ->capture_default_str();
  add_out(sub, o.out_file);
  sub.footer(
      "Example:\n  drivebench new case dc-a-voltage --command ./speed_loop --speed-rad-s 50 --load-nm 0.005 "
      "--out speed.toml\n"
      "Exit codes: 0 written and accepted, 2 an option or the bench is wrong.");
}

}  // namespace

void add_datasheet_commands(CommandLine& line) {
  CLI::App& made = *line.app().add_subcommand(
      "new", "make motor and bench files from the numbers of data sheets, and cases for tests");
  made.require_subcommand(1);
  CLI::App& motor =
      *made.add_subcommand("motor", "make a motor file from a data sheet, with every conversion shown");
  motor.require_subcommand(1);
  for (const MotorKind* const kind : kMotorKinds)
    add_new_motor(line, motor, *kind);
  add_new_bench(line, made);
  add_new_case(line, made);
}

}  // namespace drivebench::command
