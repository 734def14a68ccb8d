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
      "serve", "start a bench, a file or a name (default: servo), with arguments of drivebench-server");
  sub.prefix_command();
  sub.footer(
      "Example:\n"
      "  drivebench serve\n"
      "  drivebench serve bm500\n"
      "  drivebench serve servo --mode realtime --record live.mcap\n"
      "This is what people use. It becomes drivebench-server, which services and containers start, with the "
      "same arguments behind the path of a bench file; drivebench-server --help lists them.");
  line.when_named(sub, [&sub] { return run_serve(sub.remaining()); });
}

void add_describe(CommandLine& line) {
  const auto [sub, o] = line.add<DescribeOptions>(
      "describe", "list axes, parameters, signals and faults of a bench", run_describe);
  add_link(sub, o.link);
  sub.footer("Example:\n  drivebench describe");
}

void add_status(CommandLine& line) {
  const auto [sub, o] = line.add<StatusOptions>("status", "tell what a bench is doing", run_status);
  add_link(sub, o.link);
  sub.footer("Example:\n  drivebench status");
}

/// The axis as an option; `number` is its default.
void add_axis_option(CLI::App& sub, std::string& number) {
  sub.add_option("--axis", number, "axis of the bench, by number or name")
      ->type_name("AXIS")
      ->capture_default_str();
}

/// The axis as the first argument.
void add_axis(CLI::App& sub, std::string& axis) {
  sub.add_option("AXIS", axis, "axis of the bench, by number or name")->type_name("AXIS")->required();
}

void add_watch(CommandLine& line) {
  const auto [sub, o] = line.add<WatchOptions>("watch", "show live values of an axis", run_watch);
  add_link(sub, o.link);
  begin_group(sub, kWhat);
  add_axis_option(sub, o.axis);
  sub.add_option(
         "--signals", o.signals,
         "names of signals, separated by commas, shown behind tick and time_s; default: the usual ones "
         "of the axis")
      ->type_name("SIGNAL")
      ->delimiter(',');
  begin_group(sub, kLimits);
  sub.add_option(
         "--rate", o.rate_hz,
         "samples per second of the bench's time; default: 10, in lockstep 1000, so that a move of 0.1 s "
         "shows")
      ->type_name("HZ")
      ->check(finite_between(1e-6, kMost));
  sub.add_option("--count", o.count, "end after this many samples; 0: go on until Ctrl-C")
      ->type_name("NUMBER")
      ->check(not_negative())
      ->capture_default_str();
  sub.footer(
      "Example:\n  drivebench watch --signals speed_rad_s,i_a_a --rate 20\n"
      "In a terminal keys choose the signals; the last line tells which keys.");
}

void add_conduct(CLI::App& sub, LinkChoice& link) {
  sub.add_flag("--conduct", link.conducts,
               "do it also while another session controls the axis; needs the role conductor")
      ->group(kConnection);
}

void add_inject(CommandLine& line) {
  const auto [sub, o] = line.add<InjectOptions>("inject", "put a fault into an axis", run_inject);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  add_axis(sub, o.axis);
  sub.add_option("FAULT", o.fault, "name of the fault; `drivebench describe` lists them")
      ->type_name("FAULT")
      ->required();
  sub.add_option("VALUE", o.value, "how strong or which one, as describe tells; 0 takes the fault away")
      ->type_name("NUMBER")
      ->required()
      ->check(finite_between(-kMost, kMost));
  sub.footer("Example:\n  drivebench inject servo open_phase 2\n  drivebench inject servo open_phase 0");
}

void add_set(CommandLine& line) {
  const auto [sub, o] = line.add<SetOptions>("set", "write a parameter of an axis", run_set);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  add_axis(sub, o.axis);
  sub.add_option("NAME", o.name, "name of the parameter; `drivebench describe` lists them")
      ->type_name("NAME")
      ->required();
  sub.add_option(
         "VALUE", o.value,
         "a number in the parameter's unit, a word if it is a choice, true or false if it is a switch")
      ->type_name("VALUE")
      ->required();
  begin_group(sub, kLimits);
  sub.add_option("--ramp-s", o.ramp_s, "go there in a ramp of this length, in the bench's time; 0: at once")
      ->type_name("SECONDS")
      ->check(finite_between(0.0, kMost_s));
  sub.footer("Example:\n  drivebench set servo machine.rotor_resistance_ohm 5.85");
}

void add_bump(CommandLine& line) {
  const auto [sub, o] = line.add<BumpOptions>("bump", "hit the shaft of an axis", run_bump);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  add_axis(sub, o.axis);
  sub.add_option("IMPULSE", o.impulse_nms, "torque impulse [N*m*s], positive like a machine torque")
      ->type_name("N*m*s")
      ->required()
      ->check(finite_between(-kMost, kMost));
  sub.footer("Example:\n  drivebench bump servo 0.001");
}

void add_clear(CommandLine& line) {
  const auto [sub, o] = line.add<ClearOptions>(
      "clear", "clear the latched faults of an axis that no session controls", run_clear);
  add_link(sub, o.link);
  add_axis(sub, o.axis);
  sub.footer("Example:\n  drivebench clear servo");
}

void add_take(CommandLine& line) {
  const auto [sub, o] = line.add<TakeOptions>(
      "take", "take an axis from the session that holds it and leave it free; for administrators", run_take);
  add_link(sub, o.link);
  begin_group(sub, kWhat);
  add_axis_option(sub, o.axis);
  sub.add_flag("--force", o.force, "the session loses it at once, and the axis goes to its safe action");
  sub.add_option("--reason", o.reason, "what the session is told, and what the audit log keeps")
      ->type_name("REASON")
      ->required();
  sub.footer("Example:\n  drivebench take --axis servo --force --reason 'next user of the bench'");
}

void add_branch(CommandLine& line) {
  CLI::App& sub = *line.app().add_subcommand(
      "branch",
      "start a second bench that goes on from the present state of one: branch BENCH [ARGUMENT ...]");
  const auto o = std::make_shared<BranchOptions>();
  add_link(sub, o->link);
  add_conduct(sub, o->link);
  sub.add_option(
         "BENCH", o->config,
         "bench file of both, or the name of one of configs/benches; the arguments behind it are those "
         "of drivebench-server")
      ->type_name("BENCH")
      ->required();
  sub.prefix_command();
  sub.footer("Example:\n  drivebench branch servo --port 0");
  line.when_named(sub, [&sub, o] {
    o->arguments = sub.remaining();
    return run_branch(*o);
  });
}

void add_save(CommandLine& line) {
  const auto [sub, o] = line.add<SaveOptions>("save", "write the whole state of a bench to a file", run_save);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("STATE", o.file, "a new file for the state")->type_name("FILE")->required();
  sub.footer("Example:\n  drivebench save here.state");
}

void add_restore(CommandLine& line) {
  const auto [sub, o] = line.add<RestoreOptions>("restore", "bring a bench to a saved state", run_restore);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.add_option("STATE", o.file, "what `drivebench save` has written, of the same bench")
      ->type_name("FILE")
      ->required();
  sub.footer("Example:\n  drivebench restore here.state");
}

void add_reset(CommandLine& line) {
  const auto [sub, o] = line.add<ResetOptions>("reset", "bring a bench back to tick 0", run_reset);
  add_link(sub, o.link);
  add_conduct(sub, o.link);
  sub.footer("Example:\n  drivebench reset");
}

/// A verb that prints a description of a bench file by the server.
Verb<PrintOptions> add_print(CommandLine& line, const std::string& name, const std::string& description,
                             const std::string& bench) {
  const Verb<PrintOptions> verb = line.add<PrintOptions>(name, description, run_print);
  verb.options.what = name;
  verb.app.add_option("BENCH", verb.options.config, "a bench file, or the name of one of configs/benches")
      ->type_name("BENCH")
      ->capture_default_str();
  verb.app.footer("Example:\n  drivebench " + name + " " + bench);
  begin_group(verb.app, kOutput);
  return verb;
}

void add_prints(CommandLine& line) {
  for (const auto& [name, description] :
       {std::pair("dbc", "print the CAN frames of a bench as a DBC file"),
        std::pair("can-table", "print the CAN frames of a bench in Markdown")}) {
    const auto [sub, o] = add_print(line, name, description, "servo-can");
    sub.add_option("--bus", o.bus, "which [[can]] section of the file, counted from 1")
        ->type_name("NUMBER")
        ->check(not_negative())
        ->capture_default_str();
  }
  const auto [sub, o] =
      add_print(line, "modbus-map", "print the Modbus registers of a bench in Markdown", "servo-modbus");
  sub.add_flag_callback(
      "--csv", [&what = o.what] { what = "modbus-csv"; }, "print CSV instead of Markdown");
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
