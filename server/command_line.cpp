#include "server/command_line.hpp"

#include <fmt/core.h>

#include <CLI/CLI.hpp>

#include "protocols/pages/limits.hpp"
#include "protocols/pages/line_description.hpp"
#include "protocols/pages/write_pages.hpp"
#include "server/config/config.hpp"
#include "server/host/build_id.hpp"

namespace drivebench {
namespace {

using pages::finite_between;
using pages::kMost_s;
using pages::whole_between;

/// Refuses an empty value, which a script gives when its variable is not set.
std::string not_empty(const std::string& value) {
  return value.empty() ? "must not be empty" : "";
}

void add_run(CLI::App& app, ServerOptions& o) {
  app.option_defaults()->group("The run");
  app.add_option("--mode", o.mode,
                 "realtime: time is wall time; lockstep: time waits for the controllers; free: it waits for "
                 "nothing; default: that of the bench file")
      ->type_name("MODE")
      ->check(CLI::IsMember({"realtime", "lockstep", "free"}));
  app.add_option("--from", o.from, "begin with this state, which drivebench save has written")
      ->type_name("FILE")
      ->check(not_empty);
  auto* repeat = app.add_option("--repeat", o.repeat,
                                "in lockstep: begin with the run in this recording up to --until, where its "
                                "controllers give their leases up")
                     ->type_name("FILE")
                     ->check(not_empty)
                     ->excludes("--from");
  repeat->needs(app.add_option("--until", o.until, "the tick up to which --repeat goes")
                    ->type_name("TICK")
                    ->check(whole_between(0, static_cast<std::int64_t>(kMaxTick)))
                    ->needs(repeat));
  app.add_option("--duration", o.duration_s,
                 "stop after this much plant time; in lockstep time then stands still until the end")
      ->type_name("SECONDS")
      ->check(finite_between(1e-9, kMost_s));
  app.add_option("--command-delay-ticks", o.command_delay_ticks,
                 "ticks from a command to its effect; default: that of the bench file")
      ->type_name("TICKS")
      ->check(whole_between(0, 1));
  app.add_flag("--require-rt", o.require_realtime,
               "do not start without real-time scheduling and locked memory");
  app.add_option("--fail-on-late", o.fail_on_late, "exit code 3 if more ticks than this were late")
      ->type_name("TICKS")
      ->check(whole_between(0, 1'000'000'000'000'000));
  app.add_flag("--allow-odd", o.allow_odd, "take values that hardly any machine has; only warn");
  app.add_flag("--allow-overload", o.allow_overload,
               "in real time: start with a CAN bus that cannot carry all frames");
  auto* messages = app.add_option("--messages", o.messages,
                                  "tell the device under test what the [[message]] tables of this file say")
                       ->type_name("FILE")
                       ->check(not_empty);
  app.add_option("--lines", o.lines, "the file or FIFO that takes lines of --messages")
      ->type_name("FILE")
      ->check(not_empty)
      ->needs(messages);
  app.add_option("--experiments", o.experiments, "keep experiments in this folder and let clients run them")
      ->type_name("FOLDER")
      ->check(not_empty);
}

void add_record(CLI::App& app, ServerOptions& o) {
  app.option_defaults()->group("Recording");
  auto* record = app.add_option("--record", o.record, "write an MCAP recording to this new file")
                     ->type_name("FILE")
                     ->check(not_empty)
                     ->excludes("--from");
  app.add_option("--record-file-s", o.file_s,
                 "begin a new file after this much plant time: FILE.mcap, FILE.2.mcap ...")
      ->type_name("SECONDS")
      ->check(finite_between(1e-9, kMost_s))
      ->needs(record);
  app.add_option("--record-file-mib", o.file_mib, "begin a new file after this many MiB")
      ->type_name("MIB")
      ->check(whole_between(1, std::int64_t{1} << 30))
      ->needs(record);
  app.add_option("--record-chunk-ms", o.chunk_ms,
                 "write after this much plant time, the most that a kill costs; default: 100, in free mode "
                 "1000")
      ->type_name("MILLISECONDS")
      ->check(finite_between(1.0, 10'000.0))
      ->needs(record);
}

void add_output(CLI::App& app, ServerOptions& o) {
  app.option_defaults()->group(pages::kOutput);
  auto* json = app.add_flag("--json", o.json, "print JSON lines instead of text");
  app.add_flag("--measure-answers", o.measure_answers,
               "tell in the verdict how long after the samples the commands came")
      ->needs(json);
  app.add_option("--log-format", o.log_format, "how standard error is written; json: an object in each line")
      ->type_name("FORMAT")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  app.add_option("--audit", o.audit, "append the audit log to this file, as JSON lines")
      ->type_name("FILE")
      ->check(not_empty);
}

/// What the program does instead of serving.
CLI::Option* add_instead(CLI::App& app, ServerOptions& o) {
  app.option_defaults()->group("Instead of a server");
  auto* replay = app.add_option("--replay", o.replay, "simulate a recording again and compare it bit for bit")
                     ->type_name("FILE")
                     ->check(not_empty);
  app.add_flag("--check-config", o.check_config, "only check the bench file");
  app.add_option("--print", o.print, "only print a description of an interface")
      ->type_name("WHAT")
      ->check(CLI::IsMember({"dbc", "can-table", "modbus-map", "modbus-csv"}));
  app.add_option("--bus", o.bus, "which [[can]] section --print is about, counted from 1")
      ->type_name("NUMBER")
      ->check(whole_between(1, kMaxCanBuses));
  return replay;
}

}  // namespace

std::optional<bool> read_command_line(int argc, char** argv, ServerOptions& o) {
  CLI::App app(
      "drivebench-server: emulates electric drives in deterministic real time and serves them to "
      "controllers.");
  app.footer(
      "Example:\n"
      "  drivebench-server configs/benches/servo.toml\n"
      "  drivebench-server configs/benches/im-b.toml --duration 2 --record start.mcap\n"
      "  drivebench-server --replay start.mcap\n"
      "Exit codes: 0 done, 1 a replay differs or a recording lost entries, 2 configuration, command line or "
      "file unusable, 3 later than --fail-on-late allows, or a replayed recording that is equal and has no "
      "end.");
  auto* config = app.add_option("BENCH", o.config, "a bench file (TOML)")->type_name("FILE");
  app.option_defaults()->group(pages::kConnection);
  app.add_option("--port", o.port, "TCP port, instead of that of the bench file; 0: chosen by the system")
      ->type_name("PORT")
      ->check(whole_between(0, 65535));
  app.add_option("--unix", o.unix_path, "also listen on this unix socket")
      ->type_name("FILE")
      ->check(not_empty);
  app.add_option(
         "--spin-us", o.spin_us,
         "look for so long for the next request before sleeping: quicker answers for a CPU of its own; "
         "default: 0")
      ->type_name("MICROSECONDS")
      ->check(whole_between(0, 1000));
  add_run(app, o);
  add_record(app, o);
  add_instead(app, o)->excludes(config);
  add_output(app, o);
  pages::add_pages(app, {.name = "drivebench-server",
                         .version = fmt::format("drivebench {}", project_version()),
                         .section = "8",
                         .see_also = {"drivebench(1)"}});
  app.set_version_flag("--version",
                       fmt::format("drivebench-server {}, build {}", project_version(), build_id()),
                       "print version and build and end")
      ->group(pages::kHelp);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0;
  }
  if (o.config.empty() && o.replay.empty()) {
    fmt::print(stderr, "a bench file is needed, for example configs/benches/servo.toml; see --help\n");
    return false;
  }
  return std::nullopt;
}

}  // namespace drivebench
