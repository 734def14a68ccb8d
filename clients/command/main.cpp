#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "clients/command/can/can_check.hpp"
#include "clients/command/common/commands.hpp"
#include "clients/command/common/json.hpp"
#include "clients/command/common/line_values.hpp"
#include "clients/command/experiment/experiment_line.hpp"
#include "clients/command/identify/identify_line.hpp"
#include "clients/link/tcp_link.hpp"

namespace drivebench::command {
namespace {

/// Everything the command line can say, and what to do about it.
struct CommandLine {
  CLI::App app{"drivebench: a hardware-in-the-loop test bench for electric drives."};
  std::function<int()> action;
  LinkChoice link;
  bool json = false;
  StatusOptions status;
  DescribeOptions describe;
  WatchOptions watch;
  InjectOptions inject;
  SetOptions set;
  BumpOptions bump;
  TakeOptions take;
  ControlOptions control;
  CompareOptions compare;
  PlotOptions plot;
  std::vector<std::string> loads;
  std::vector<std::string> settings;
  std::vector<std::string> gains;
  PrintOptions print;
  CanCheckOptions can_check;
  bool csv = false;
  CanLogOptions can_log;
  ReplayOptions replay;
  ExportOptions export_;
  DemoOptions demo;
  ExperimentOptions experiment;
  IdentifyOptions identify;

  CommandLine() {
    // Not CLI11's envname(): it lets the options of subcommands that were not named overwrite ours.
    if (const char* address = std::getenv("DRIVEBENCH_LINK"); address != nullptr) link.address = address;
    if (const char* token = std::getenv("DRIVEBENCH_TOKEN"); token != nullptr) link.token = token;
    app.require_subcommand(1);
    app.footer("Exit codes: 0 ok, 1 the run failed, 2 usage or configuration, 3 cannot connect.");
    add_serve();
    add_demo();
    add_observers();
    add_changes();
    add_take();
    add_control();
    add_interfaces();
    add_recordings();
    add_export();
    add_plot();
    add_experiment_commands(app, link, json, experiment,
                            [this](auto run_it) { action = [this, run_it] { return run_it(experiment); }; });
    add_identify_command(app, link, json, identify,
                         [this] { action = [this] { return run_identify(identify); }; });
  }

  bool knows(std::string_view subcommand) const {
    return !app.get_subcommands([&](const CLI::App* sub) { return sub->get_name() == subcommand; }).empty();
  }

 private:
  CLI::App* add(const std::string& name, const std::string& description) {
    CLI::App* sub = app.add_subcommand(name, description);
    sub->add_flag("--json", json, "print JSON");
    return sub;
  }

  CLI::App* add_linked(const std::string& name, const std::string& description,
                       const std::string& links = kStreamLinks) {
    CLI::App* sub = add(name, description);
    sub->add_option("--link", link.address, links + "; else from DRIVEBENCH_LINK")->capture_default_str();
    sub->add_option("--token", link.token, "what the server asks for; else from DRIVEBENCH_TOKEN");
    return sub;
  }

  void add_serve() {
    CLI::App* sub = app.add_subcommand(
        "serve", "start drivebench-server: serve [BENCH.toml or name, default servo] [its arguments]");
    sub->prefix_command();
    sub->callback([this, sub] { action = [sub] { return run_serve(sub->remaining()); }; });
  }

  void add_demo() {
    CLI::App* sub = add("demo", "one move in lockstep and in real time, compared, recorded and replayed");
    sub->add_option("--keep", demo.folder, "folder for the recordings")->capture_default_str();
    sub->callback([this] {
      demo.json = json;
      action = [this] { return run_demo(demo); };
    });
  }

  void add_observers() {
    add_linked("describe", "axes, parameters, signals and faults of a bench")->callback([this] {
      describe = {.link = link, .json = json};
      action = [this] { return run_describe(describe); };
    });
    add_linked("status", "what a bench is doing")->callback([this] {
      status = {.link = link, .json = json};
      action = [this] { return run_status(status); };
    });
    CLI::App* sub = add_linked("watch", "live values of an axis");
    sub->add_option("--axis", watch.axis, "number or name")->capture_default_str();
    sub->add_option("--signals", watch.signals, "names, separated by commas")->delimiter(',');
    sub->add_option("--rate", watch.rate_hz, "samples per second of the bench's time")
        ->check(finite_between(1e-6, kMost))
        ->capture_default_str();
    sub->add_option("--count", watch.count, "end after so many samples; 0: never")
        ->check(not_negative())
        ->capture_default_str();
    sub->callback([this] {
      watch.link = link;
      watch.json = json;
      action = [this] { return run_watch(watch); };
    });
  }

  void add_changes() {
    CLI::App* sub = add_linked("inject", "put a fault into an axis that nobody controls");
    sub->add_option("AXIS", inject.axis, "number or name")->required();
    sub->add_option("FAULT", inject.fault, "name, as describe lists them")->required();
    sub->add_option("VALUE", inject.value, "0 takes it away")
        ->required()
        ->check(finite_between(-kMost, kMost));
    sub->callback([this] {
      inject.link = link;
      inject.json = json;
      action = [this] { return run_inject(inject); };
    });
    sub = add_linked("set", "write a parameter of an axis that nobody controls");
    sub->add_option("AXIS", set.axis, "number or name")->required();
    sub->add_option("NAME", set.name, "as describe lists them")->required();
    sub->add_option("VALUE", set.value, "a number, or the word of a choice")->required();
    sub->add_option("--ramp-s", set.ramp_s, "seconds of the bench's time on the way there")
        ->check(finite_between(0.0, kMost_s));
    sub->callback([this] {
      set.link = link;
      set.json = json;
      action = [this] { return run_set(set); };
    });
    sub = add_linked("bump", "hit the shaft of an axis that nobody controls");
    sub->add_option("AXIS", bump.axis, "number or name")->required();
    sub->add_option("IMPULSE", bump.impulse_nms, "[N*m*s], positive like a machine torque")
        ->required()
        ->check(finite_between(-kMost, kMost));
    sub->callback([this] {
      bump.link = link;
      bump.json = json;
      action = [this] { return run_bump(bump); };
    });
  }

  void add_take() {
    CLI::App* sub =
        add_linked("take", "take an axis from whoever holds it and leave it free; for administrators");
    sub->add_option("--axis", take.axis, "number or name")->capture_default_str();
    sub->add_flag("--force", take.force, "he loses it at once, and the axis goes to its safe action");
    sub->add_option("--reason", take.reason, "what he is told, and what the audit log keeps")->required();
    sub->callback([this] {
      take.link = link;
      take.json = json;
      action = [this] { return run_take(take); };
    });
  }

  void add_control() {
    CLI::App* sub =
        add_linked("control", "run the reference controller on a move",
                   std::string(kStreamLinks) + ", can:BACKEND:CHANNEL?node=N, modbus:HOST:PORT?unit=N");
    sub->add_option("--preset", control.preset, "gains and move by name")->capture_default_str();
    sub->add_flag("--list", control.list, "print the presets and end; with --gains all their gains");
    sub->add_flag("--gains", control.gains, "print the gains of the preset and end");
    sub->add_option("--gain", gains, "NAME=VALUE: another value for a gain of the preset");
    sub->add_option("--compare", compare.recording,
                    "MCAP recording of your controller: what the preset's would have commanded");
    sub->add_option("--with", compare.other, "--compare: recording of the preset's own run, compared too");
    sub->add_option("--from", compare.from_tick, "--compare: tick at which the run starts")
        ->check(not_negative());
    sub->add_option("--threshold", compare.threshold,
                    "--compare: [V] or [A]; exit code 1 if a command differs by more, or the recording does "
                    "not hold the whole run")
        ->check(finite_between(0.0, kMost));
    sub->add_option("--axis", control.axis, "number or name; CAN and Modbus links name it themselves")
        ->capture_default_str();
    sub->add_option("--csv", control.csv_file, "write every sample to this file");
    sub->add_option(
        "--load", loads,
        "NM@SECONDS: load torque at a time after the start of the trajectory; put back at the end");
    sub->add_option("--set", settings, "NAME=VALUE: write a parameter of the axis first; it stays");
    sub->add_flag("--clear", control.clear_faults, "clear latched faults first");
    sub->callback([this] {
      control.link = link;
      control.json = json;
      for (const std::string& load : loads)
        control.loads.push_back(parse_load(load));
      for (const std::string& setting : settings)
        control.settings.push_back(parse_setting(setting));
      control.overrides = parsed_gains();
      action = [this] { return run_control_or_compare(); };
    });
  }

  std::vector<control::Gain> parsed_gains() const {
    std::vector<control::Gain> parsed;
    for (const std::string& gain : gains) {
      const ParameterSetting setting = parse_setting(gain);
      parsed.push_back({setting.name, setting.value});
    }
    return parsed;
  }

  int run_control_or_compare() {
    if (compare.recording.empty()) {
      if (!compare.other.empty() || compare.from_tick || compare.threshold) {
        throw UsageError("--with, --from and --threshold belong to --compare");
      }
      return run_control(control);
    }
    compare.json = json;
    compare.preset = control.preset;
    compare.overrides = control.overrides;
    compare.axis = control.axis;
    return run_compare(compare);
  }

  void add_print(const std::string& name, const std::string& description, bool has_bus) {
    CLI::App* sub = app.add_subcommand(name, description);
    sub->add_option("CONFIG", print.config, "bench file or its name")->capture_default_str();
    if (has_bus) {
      sub->add_option("--bus", print.bus, "which [[can]] section, from 1 on")
          ->check(not_negative())
          ->capture_default_str();
    } else {
      sub->add_flag("--csv", csv, "CSV instead of Markdown");
    }
    sub->callback([this, name] {
      print.what = csv ? "modbus-csv" : name;
      action = [this] { return run_print(print); };
    });
  }

  void add_interfaces() {
    add_print("dbc", "the CAN frames of a bench as a DBC file", true);
    add_print("can-table", "the CAN frames of a bench in Markdown", true);
    add_print("modbus-map", "the Modbus registers of a bench", false);
    CLI::App* can = app.add_subcommand("can", "CAN interfaces of this computer");
    can->require_subcommand(1);
    CLI::App* check = can->add_subcommand("check", "how an interface is doing, what is wrong and the cure");
    check->add_option("IFACE", can_check.interface, "for example can0")->required();
    check->add_flag("--classic", can_check.classic, "classic frames will do");
    check->add_flag("--json", json, "print JSON");
    check->footer("Exit codes: 0 nothing is wrong, 1 something is, 2 there is no such CAN interface.");
    check->callback([this] {
      can_check.json = json;
      action = [this] { return run_can_check(can_check); };
    });
    CLI::App* sub = app.add_subcommand("can-log", "write what is on a CAN bus, as candump -l does");
    sub->add_option("LINK", can_log.address, "can:BACKEND:CHANNEL, for example can:socketcan:vcan0")
        ->required();
    sub->add_option("--output", can_log.out_file, "instead of standard output");
    sub->add_option("--count", can_log.count, "end after so many frames; 0: never")
        ->check(not_negative())
        ->capture_default_str();
    sub->add_option("--duration", can_log.duration_s, "end after so many seconds; 0: never")
        ->check(finite_between(0.0, kMost_s))
        ->capture_default_str();
    sub->callback([this] { action = [this] { return run_can_log(can_log); }; });
  }

  void add_recordings() {
    CLI::App* sub = add("replay", "re-simulate a recording and compare it bit for bit");
    sub->add_option("FILE", replay.recording, "an MCAP recording")->required();
    sub->callback([this] {
      replay.json = json;
      action = [this] { return run_replay(replay); };
    });
  }

  void add_plot() {
    CLI::App* sub = app.add_subcommand("plot", "a controlled run of a recording as an SVG picture");
    sub->add_option("FILE", plot.recording, "an MCAP recording")->required();
    sub->add_option("--out", plot.out_file, "instead of standard output");
    sub->add_option("--preset", plot.preset, "draws its trajectory and the error too");
    sub->add_option("--gain", gains, "NAME=VALUE: another value for a gain of the preset");
    sub->add_option("--axis", plot.axis, "name; default: the first in the file");
    sub->add_option("--from", plot.from_tick, "tick at which the run starts")->check(not_negative());
    sub->add_option("--panels", plot.panels,
                    "of angle, speed, error, currents, voltages, torque, separated by commas")
        ->delimiter(',');
    sub->add_option("--title", plot.title, "default: the preset, or else the file");
    sub->callback([this] {
      plot.overrides = parsed_gains();
      action = [this] { return run_plot(plot); };
    });
  }

  void add_export() {
    CLI::App* sub = add("export", "a recording as CSV or as a CAN trace");
    sub->add_option("--format", export_.format, "csv: samples; candump: the frames that a CAN bus would have")
        ->check(CLI::IsMember({"csv", "candump"}))
        ->capture_default_str();
    sub->add_option("--interface", export_.interface, "candump: name of the interface")
        ->capture_default_str();
    sub->add_option("--node-base", export_.node_base, "candump: node id of the first axis")
        ->check(CLI::Range(1, 127))
        ->capture_default_str();
    sub->add_flag("--classic", export_.classic, "candump: classic frames instead of FD");
    sub->add_option("--profile", export_.profile,
                    "candump: as in a can: link, current_unit_a=0.01&extended=1");
    sub->add_option("FILE", export_.recording, "an MCAP recording")->required();
    sub->add_option("--out", export_.out_file, "instead of standard output");
    sub->add_option("--axis", export_.axis, "name; default: the first in the file");
    sub->add_option("--signals", export_.signals, "names, separated by commas")->delimiter(',');
    sub->add_option("--from", export_.from_tick, "first tick")->check(not_negative());
    sub->add_option("--to", export_.to_tick, "last tick")->check(not_negative());
    sub->footer("Exit code 3: the recording ends early; what is there was written.");
    sub->callback([this] {
      export_.json = json;
      action = [this] { return run_export(export_); };
    });
  }
};

int fail(const CommandLine& line, int code, std::string_view kind, std::string_view message,
         std::string_view field = {}) {
  std::fflush(stdout);
  if (line.json) fmt::print("{}\n", error_json(kind, message, field));
  fmt::print(stderr, "drivebench: {}\n", message);
  return code;
}

int run(int argc, char** argv) {
  CommandLine line;
  try {
    if (argc > 1 && argv[1][0] != '-' && !line.knows(argv[1])) {
      throw UsageError(fmt::format("no subcommand '{}'; --help lists them", argv[1]));
    }
    line.app.parse(argc, argv);
    return line.action();
  } catch (const CLI::ParseError& error) {
    return line.app.exit(error) == 0 ? kExitOk : kExitUsage;
  } catch (const UsageError& error) {
    return fail(line, kExitUsage, "usage", error.what());
  } catch (const link::AddressError& error) {
    return fail(line, kExitUsage, "usage", error.what());
  } catch (const link::ConnectError& error) {
    return fail(line, kExitNoConnect, "connect", error.what());
  } catch (const link::Refused& refused) {
    return fail(line, kExitFailed, "refused", refused.what(), refused.field());
  } catch (const std::exception& error) {
    return fail(line, kExitFailed, "failed", error.what());
  }
}

}  // namespace
}  // namespace drivebench::command

int main(int argc, char** argv) {
  return drivebench::command::run(argc, argv);
}
