#include "clients/command/bench/bench_line.hpp"

#include "clients/command/bench/change.hpp"
#include "clients/command/bench/describe.hpp"
#include "clients/command/bench/serve.hpp"
#include "clients/command/bench/state.hpp"
#include "clients/command/bench/status.hpp"
#include "clients/command/bench/watch.hpp"
#include "clients/command/common/line/command_line.hpp"

namespace drivebench::command {
namespace {

void add_serve(CommandLine& line) {
  CLI::App& sub = *line.app().add_subcommand(
      "serve", "start drivebench-server: serve [BENCH.toml or name, default servo] [its arguments]");
  sub.prefix_command();
  sub.footer(
      "Examples: drivebench serve bm500; drivebench serve my-bench.toml --mode realtime --record run.mcap\n"
      "This is what people use. It becomes drivebench-server, which services and containers start, with the "
      "same\n"
      "arguments behind the path of a bench file; drivebench-server --help lists them.");
  line.when_named(sub, [&sub] { return run_serve(sub.remaining()); });
}

void add_describe(CommandLine& line) {
  const auto [sub, o] =
      line.add<DescribeOptions>("describe", "axes, parameters, signals and faults of a bench", run_describe);
  add_link(sub, o.link);
}

void add_status(CommandLine& line) {
  const auto [sub, o] = line.add<StatusOptions>("status", "what a bench is doing", run_status);
  add_link(sub, o.link);
}

void add_watch(CommandLine& line) {
  const auto [sub, o] = line.add<WatchOptions>("watch", "live values of an axis", run_watch);
  add_link(sub, o.link);
  sub.add_option("--axis", o.axis, "number or name")->capture_default_str();
  sub.add_option("--signals", o.signals, "names, separated by commas")->type_name("SIGNAL")->delimiter(',');
  sub.add_option("--rate", o.rate_hz, "samples per second of the bench's time")
      ->check(finite_between(1e-6, kMost))
      ->capture_default_str();
  sub.add_option("--count", o.count, "end after so many samples; 0: never")
      ->check(not_negative())
      ->capture_default_str();
}

void add_conduct(CLI::App& sub, LinkChoice& link) {
  sub.add_flag("--conduct", link.conducts,
               "also while another session controls the axis; needs the role conductor");
}

void add_inject(CommandLine& line) {
  const auto [sub, o] = line.add<InjectOptions>("inject", "put a fault into an axis", run_inject);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("AXIS", o.axis, "number or name")->required();
  sub.add_option("FAULT", o.fault, "name, as describe lists them")->required();
  sub.add_option("VALUE", o.value, "0 takes it away")->required()->check(finite_between(-kMost, kMost));
}

void add_set(CommandLine& line) {
  const auto [sub, o] = line.add<SetOptions>("set", "write a parameter of an axis", run_set);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("AXIS", o.axis, "number or name")->required();
  sub.add_option("NAME", o.name, "as describe lists them")->required();
  sub.add_option("VALUE", o.value, "a number, or the word of a choice")->required();
  sub.add_option("--ramp-s", o.ramp_s, "seconds of the bench's time on the way there")
      ->check(finite_between(0.0, kMost_s));
}

void add_bump(CommandLine& line) {
  const auto [sub, o] = line.add<BumpOptions>("bump", "hit the shaft of an axis", run_bump);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("AXIS", o.axis, "number or name")->required();
  sub.add_option("IMPULSE", o.impulse_nms, "[N*m*s], positive like a machine torque")
      ->required()
      ->check(finite_between(-kMost, kMost));
}

void add_clear(CommandLine& line) {
  const auto [sub, o] = line.add<ClearOptions>(
      "clear", "clear the latched faults of an axis that no session controls", run_clear);
  add_link(sub, o.link);
  sub.add_option("AXIS", o.axis, "number or name")->required();
}

void add_take(CommandLine& line) {
  const auto [sub, o] = line.add<TakeOptions>(
      "take", "take an axis from the session that holds it and leave it free; for administrators", run_take);
  add_link(sub, o.link);
  sub.add_option("--axis", o.axis, "number or name")->capture_default_str();
  sub.add_flag("--force", o.force, "the session loses it at once, and the axis goes to its safe action");
  sub.add_option("--reason", o.reason, "what the session is told, and what the audit log keeps")->required();
}

void add_branch(CommandLine& line) {
  CLI::App& sub = *line.app().add_subcommand(
      "branch", "start a second server that goes on from the present state of a bench");
  const auto o = std::make_shared<BranchOptions>();
  add_link(sub, o->link);
  add_conduct(sub, o->link);
  sub.add_option("BENCH", o->config, "its bench file or name, then arguments of the new server")
      ->required()
      ->type_name("BENCH");
  sub.prefix_command();
  line.when_named(sub, [&sub, o] {
    o->arguments = sub.remaining();
    return run_branch(*o);
  });
}

void add_save(CommandLine& line) {
  const auto [sub, o] =
      line.add<SaveOptions>("save", "write the whole state of a bench to a file", run_save);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("STATE", o.file, "a new file")->required()->type_name("FILE");
}

void add_restore(CommandLine& line) {
  const auto [sub, o] = line.add<RestoreOptions>("restore", "go on from a saved state", run_restore);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("STATE", o.file, "from save, of the same bench")->required()->type_name("FILE");
}

void add_reset(CommandLine& line) {
  const auto [sub, o] = line.add<ResetOptions>("reset", "bring a bench back to tick 0", run_reset);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
}

/// A verb that prints a description of a bench file by the server.
Verb<PrintOptions> add_print(CommandLine& line, const std::string& name, const std::string& description) {
  const Verb<PrintOptions> verb = line.add<PrintOptions>(name, description, run_print);
  verb.options.what = name;
  verb.app.add_option("CONFIG", verb.options.config, "bench file or its name")
      ->type_name("BENCH")
      ->capture_default_str();
  return verb;
}

void add_prints(CommandLine& line) {
  for (const auto& [name, description] : {std::pair("dbc", "the CAN frames of a bench as a DBC file"),
                                          std::pair("can-table", "the CAN frames of a bench in Markdown")}) {
    const auto [sub, o] = add_print(line, name, description);
    sub.add_option("--bus", o.bus, "which [[can]] section, from 1 on")
        ->check(not_negative())
        ->capture_default_str();
  }
  const auto [sub, o] = add_print(line, "modbus-map", "the Modbus registers of a bench");
  sub.add_flag_callback(
      "--csv", [&what = o.what] { what = "modbus-csv"; }, "CSV instead of Markdown");
}

}  // namespace

void add_bench_commands(CommandLine& line) {
  add_serve(line);
  add_describe(line);
  add_status(line);
  add_watch(line);
  add_inject(line);
  add_set(line);
  add_bump(line);
  add_clear(line);
  add_take(line);
  add_save(line);
  add_restore(line);
  add_reset(line);
  add_branch(line);
  add_prints(line);
}

}  // namespace drivebench::command
