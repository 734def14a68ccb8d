#include "clients/command/control/control_line.hpp"

#include <fmt/core.h>

#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/common/line/command_line.hpp"
#include "clients/command/control/control.hpp"
#include "clients/command/control/control_compare.hpp"
#include "clients/command/control/plot.hpp"

namespace drivebench::command {
namespace {

double number(std::string_view text, std::string_view whole) {
  const auto value = finite_number(text);
  if (!value) throw UsageError(fmt::format("'{}' in '{}' is not a number", text, whole));
  return *value;
}

std::pair<std::string_view, std::string_view> split(std::string_view text, char at, std::string_view form) {
  const std::size_t place = text.find(at);
  if (place == std::string_view::npos) throw UsageError(fmt::format("'{}' should be {}", text, form));
  return {text.substr(0, place), text.substr(place + 1)};
}

/// `0.1@0.0365`: N·m at seconds after the start of the trajectory.
LoadAt parse_load(std::string_view text) {
  const auto [load, after] = split(text, '@', "NM@SECONDS, for example 0.1@0.0365");
  const LoadAt parsed = {.load_nm = number(load, text), .after_s = number(after, text)};
  if (parsed.after_s < 0.0 || parsed.after_s > control::kLongestRun_s) {
    throw UsageError(
        fmt::format("'{}': the time must lie between 0 and {:g} s", text, control::kLongestRun_s));
  }
  return parsed;
}

/// `machine.rotor_resistance_ohm=5.85`.
ParameterSetting parse_setting(std::string_view text) {
  const auto [name, value] = split(text, '=', "NAME=VALUE");
  return {.name = std::string(name), .value = number(value, text), .written = std::string(value)};
}

/// An option that may be given several times, each text parsed into one of `values`.
template <class Value, class Parse>
void add_parsed(CLI::App& sub, const std::string& name, std::vector<Value>& values, Parse parse,
                const std::string& form, const std::string& help) {
  sub.add_option_function<std::vector<std::string>>(
         name,
         [&values, parse](const std::vector<std::string>& texts) {
           for (const std::string& text : texts)
             values.push_back(parse(text));
         },
         help)
      ->type_name(form);
}

void add_gains(CLI::App& sub, std::vector<control::Gain>& overrides) {
  const auto parse = [](const std::string& text) {
    const ParameterSetting gain = parse_setting(text);
    return control::Gain{gain.name, gain.value};
  };
  add_parsed(sub, "--gain", overrides, parse, "NAME=VALUE", "another value for a gain of the preset");
}

/// `control` runs a preset on a bench, or with --compare on a recording.
struct ControlLine : ControlOptions {
  CompareOptions compare{};
};

int run_control_or_compare(const ControlLine& line) {
  CompareOptions compare = line.compare;
  if (compare.recording.empty()) {
    if (!compare.other.empty() || compare.from_tick || compare.threshold) {
      throw UsageError("--with, --from and --threshold belong to --compare");
    }
    return run_control(line);
  }
  compare.json = line.json;
  compare.preset = line.preset;
  compare.overrides = line.overrides;
  compare.axis = line.axis;
  return run_compare(compare);
}

void add_compare(CLI::App& sub, CompareOptions& o) {
  begin_group(sub, "Compare with a recording of your controller");
  sub.add_option("--compare", o.recording,
                 "an MCAP recording of your controller: tell what the preset's would have commanded")
      ->type_name("FILE");
  sub.add_option("--with", o.other, "a recording of the preset's own run, which is compared too")
      ->type_name("FILE");
  sub.add_option("--from", o.from_tick,
                 "tick at which the run starts; default: the first command with a set-point")
      ->type_name("TICK")
      ->check(not_negative());
  sub.add_option("--threshold", o.threshold,
                 "[V] or [A]: exit code 1 if a command differs by more, or the recording does not hold the "
                 "whole run")
      ->type_name("NUMBER")
      ->check(finite_between(0.0, kMost));
}

void add_run(CLI::App& sub, ControlLine& o) {
  begin_group(sub, kWhat);
  sub.add_option("--preset", o.preset, "controller, gains and move by name")
      ->type_name("PRESET")
      ->capture_default_str();
  add_gains(sub, o.overrides);
  sub.add_option("--axis", o.axis, "axis of the bench, by number or name; CAN and Modbus links name it")
      ->type_name("AXIS")
      ->capture_default_str();
  add_parsed(sub, "--load", o.loads, parse_load, "NM@SECONDS",
             "load torque from a time on, counted from the start of the trajectory; put back at the end");
  add_parsed(sub, "--set", o.settings, parse_setting, "NAME=VALUE",
             "write a parameter of the axis first; it stays");
  sub.add_flag("--clear", o.clear_faults, "clear latched faults first");
  begin_group(sub, kLimits);
  add_parsed(sub, "--expect", o.limits, parse_limit, "NAME<=NUMBER",
             "or NAME>=NUMBER: exit code 1 if a number of the report (--json) is beyond it");
  sub.add_option("--repeat", o.repeat, "make the move this many times, each with its report; 0: until Ctrl-C")
      ->type_name("NUMBER")
      ->check(not_negative())
      ->capture_default_str();
  sub.add_option("--follow", o.follow,
                 "in lockstep: at most this many times as fast as the clock, so that watch and web show the "
                 "move; 0.01 "
                 "makes 60 ms last 6 s")
      ->type_name("SPEED")
      ->check(finite_between(0.001, 1000.0));
}

void add_control(CommandLine& line) {
  const auto [sub, o] =
      line.add<ControlLine>("control", "run the reference controller on a move", run_control_or_compare);
  add_link(sub, o.link,
           std::string(kStreamLinks) + ", inproc:BENCH, can:BACKEND:CHANNEL?node=N, modbus:HOST:PORT?unit=N");
  add_run(sub, o);
  add_compare(sub, o.compare);
  begin_group(sub, kOutput);
  sub.add_flag("--list", o.list, "print the presets and end; with --gains all their gains");
  sub.add_flag("--gains", o.gains, "print the gains of the preset and end");
  sub.add_option("--csv", o.csv_file, "write every sample to this file")
      ->type_name("FILE")
      ->excludes("--repeat");
  sub.footer(
      "Example:\n"
      "  drivebench control --list\n"
      "  drivebench control --preset book/8.2.2 --csv move.csv\n"
      "  drivebench control --follow 0.05\n"
      "  drivebench control --load 0.1@0 --set machine.rotor_resistance_ohm=5.85\n"
      "  drivebench control --link inproc:servo --expect 'peak_error_counts<=2'");
}

void add_plot(CommandLine& line) {
  const auto [sub, o] =
      line.add<PlotOptions>("plot", "draw a run of a recording as an SVG picture", run_plot);
  sub.add_option("FILE", o.recording, "an MCAP recording")->type_name("FILE")->required();
  begin_group(sub, kWhat);
  sub.add_option("--axis", o.axis, "axis of the recording, by name; default: the first in the file")
      ->type_name("AXIS");
  auto* const panels =
      sub.add_option(
             "--panels", o.panels,
             "what is drawn: angle, speed, error, currents, voltages, torque; with --preset also estimates "
             "of its controller beside the truth: speed-estimate, flux, load; separated by commas")
          ->type_name("PANEL")
          ->delimiter(',');
  sub.add_option("--signals", o.signals, "signals by name, a panel for each unit; separated by commas")
      ->type_name("SIGNAL")
      ->delimiter(',')
      ->excludes(panels);
  sub.add_option("--preset", o.preset, "draw the trajectory of this preset, and the error, too")
      ->type_name("PRESET");
  add_gains(sub, o.overrides);
  begin_group(sub, kLimits);
  sub.add_option("--from", o.from_tick,
                 "tick at which the picture starts; default: the first command with a set-point, or else the "
                 "first sample")
      ->type_name("TICK")
      ->check(not_negative());
  begin_group(sub, kOutput);
  sub.add_option("--out", o.out_file, "write to this file; default: standard output")->type_name("FILE");
  sub.add_option("--title", o.title, "title of the picture; default: the preset, or else the file")
      ->type_name("TITLE");
  sub.footer(
      "Example:\n"
      "  drivebench plot run.mcap --out run.svg\n"
      "  drivebench plot run.mcap --preset book/8.2.2 --panels speed,error --out error.svg\n"
      "  drivebench plot run.mcap --signals speed_rad_s,true_i_a_a --out signals.svg");
}

}  // namespace

void add_control_commands(CommandLine& line) {
  add_control(line);
  add_plot(line);
}

}  // namespace drivebench::command
