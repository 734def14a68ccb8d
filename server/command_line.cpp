#include "server/command_line.hpp"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <system_error>

#include "protocols/pages/write_pages.hpp"
#include "server/config/config.hpp"
#include "server/host/build_id.hpp"

namespace drivebench {
namespace {

/// Refuses an empty value, which a script gives when its variable is not set.
std::string not_empty(const std::string& value) {
  return value.empty() ? "must not be empty" : "";
}

constexpr double kMost_s = 1e9;

/// CLI11's own ranges print limits with 309 digits and let NaN pass, with which no comparison is true.
CLI::Validator real_between(double low, double high) {
  return {[low, high](std::string& text) {
            double value = 0.0;
            const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
            return good ? std::string()
                        : fmt::format("{} is not a number from {:g} to {:g}", text, low, high);
          },
          ""};
}

/// CLI11 reads -1 as the largest unsigned number.
CLI::Validator whole_between(std::int64_t low, std::int64_t high) {
  return {[low, high](std::string& text) {
            std::int64_t value = 0;
            const char* const end = text.data() + text.size();
            const auto read = std::from_chars(text.data(), end, value);
            const bool good = read.ec == std::errc{} && read.ptr == end && value >= low && value <= high;
            return good ? std::string()
                        : fmt::format("{} is not a whole number from {} to {}", text, low, high);
          },
          ""};
}

}  // namespace

std::optional<bool> read_command_line(int argc, char** argv, ServerOptions& o) {
  CLI::App app(
      "drivebench-server: emulates electric drives in deterministic real time and serves them to "
      "controllers.");
  app.set_version_flag("--version",
                       fmt::format("drivebench-server {}, build {}", project_version(), build_id()));
  app.footer(
      "Exit codes: 0 done, 1 a replay differs or a recording lost entries, 2 configuration, command line or "
      "file "
      "unusable, 3 later than --fail-on-late allows, or a replayed recording that is equal and has no end.");
  auto* config = app.add_option("config", o.config, "bench file (TOML)")->type_name("FILE");
  auto* replay =
      app.add_option("--replay", o.replay, "re-simulate a recording and compare it bit for bit; no server")
          ->type_name("FILE")
          ->check(not_empty);
  config->excludes(replay);
  app.add_option("--mode", o.mode, "instead of the mode in the bench file")
      ->check(CLI::IsMember({"realtime", "lockstep", "free"}));
  app.add_option("--port", o.port, "TCP port; 0: chosen by the system")->check(whole_between(0, 65535));
  app.add_option("--unix", o.unix_path, "also listen on this unix socket")
      ->type_name("FILE")
      ->check(not_empty);
  auto* from = app.add_option("--from", o.from, "begin with this state, which drivebench save has written")
                   ->type_name("FILE")
                   ->check(not_empty);
  auto* record = app.add_option("--record", o.record, "write an MCAP recording to this new file")
                     ->type_name("FILE")
                     ->check(not_empty);
  record->excludes(from);
  app.add_option("--record-file-s", o.file_s,
                 "a new file after this much plant time [s]: FILE.mcap, FILE.2.mcap ...")
      ->check(real_between(1e-9, kMost_s))
      ->needs(record);
  app.add_option("--record-file-mib", o.file_mib, "a new file after this many MiB")
      ->check(whole_between(1, std::int64_t{1} << 30))
      ->needs(record);
  app.add_option("--record-chunk-ms", o.chunk_ms,
                 "write after this much plant time [ms], the most that a kill costs; 100, in free mode 1000")
      ->check(real_between(1.0, 10'000.0))
      ->needs(record);
  app.add_flag("--require-rt", o.require_realtime,
               "do not start without real-time scheduling and locked memory");
  app.add_option("--duration", o.duration_s,
                 "stop after this much plant time [s]; in lockstep time then stands still until the end")
      ->check(real_between(1e-9, kMost_s));
  app.add_option("--command-delay-ticks", o.command_delay_ticks, "0 or 1, instead of the bench file's")
      ->check(whole_between(0, 1));
  app.add_option("--fail-on-late", o.fail_on_late, "exit 3 if more ticks than this were late")
      ->check(whole_between(0, 1'000'000'000'000'000));
  auto* json = app.add_flag("--json", o.json, "print JSON lines");
  app.add_flag("--measure-answers", o.measure_answers,
               "tell in the verdict how long after the samples the commands came")
      ->needs(json);
  app.add_flag("--check-config", o.check_config, "only check the bench file");
  app.add_option("--experiments", o.experiments, "keep experiments in this folder and let clients run them")
      ->type_name("FOLDER")
      ->check(not_empty);
  app.add_option("--audit", o.audit, "append the audit log to this file, as JSON lines")
      ->type_name("FILE")
      ->check(not_empty);
  app.add_option("--log-format", o.log_format, "of standard error; json: an object in each line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  app.add_flag("--allow-odd", o.allow_odd, "take values that hardly any machine has; only warn");
  app.add_flag("--allow-overload", o.allow_overload,
               "in real time: start with a CAN bus that cannot carry all frames");
  app.add_option("--print", o.print, "only print a description of an interface")
      ->check(CLI::IsMember({"dbc", "can-table", "modbus-map", "modbus-csv"}));
  app.add_option("--bus", o.bus, "which [[can]] section --print is about, from 1 on")
      ->check(whole_between(1, kMaxCanBuses));
  pages::add_write_pages(app, {.name = "drivebench-server",
                               .version = fmt::format("drivebench {}", project_version()),
                               .section = "8",
                               .see_also = {"drivebench(1)"}});
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
