#include <fmt/core.h>
#include <google/protobuf/stubs/logging.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "protocols/document.hpp"
#include "protocols/mcap/mcap_series.hpp"
#include "protocols/text.hpp"
#include "server/access/audit.hpp"
#include "server/command_line.hpp"
#include "server/config/config.hpp"
#include "server/config/sections/plausible.hpp"
#include "server/endpoints/tcp/stream_server.hpp"
#include "server/endpoints/transports.hpp"
#include "server/engine/engine.hpp"
#include "server/engine/supervisor.hpp"
#include "server/host/asio.hpp"
#include "server/host/build_id.hpp"
#include "server/host/logging/json_log.hpp"
#include "server/host/logging/log.hpp"
#include "server/host/logging/print_line.hpp"
#include "server/host/memory.hpp"
#include "server/host/run_io.hpp"
#include "server/host/service_notification.hpp"
#include "server/host/stop_signal.hpp"
#include "server/interface_text.hpp"
#include "server/messages/device_messages.hpp"
#include "server/pacing/pacer.hpp"
#include "server/recording/replay.hpp"
#include "server/replay_command.hpp"

namespace drivebench {
namespace {

enum ExitCode { kOk = 0, kFailed = 1, kUnusable = 2, kTooLate = 3 };

/// Loads the bench file; implausible values are refused unless --allow-odd accepts them.
BenchConfig load_plausible(const ServerOptions& o) {
  if (const std::filesystem::path file(o.config);
      !file.has_parent_path() && !file.has_extension() && !std::filesystem::exists(file)) {
    throw ConfigError(
        {{o.config,
          0,
          {},
          fmt::format("is no file; `drivebench serve {}` finds a bench by its name", printable(o.config))}});
  }
  std::vector<ConfigProblem> odd;
  BenchConfig config = load_config(o.config, odd);
  if (odd.empty()) return config;
  if (!o.allow_odd) throw ConfigError(std::move(odd));
  log::warn("{}", ConfigError(std::move(odd)).what());
  return config;
}

/// The configuration of the file with the changes of the command line.
BenchConfig configure(const ServerOptions& o) {
  BenchConfig config = load_plausible(o);
  if (!o.mode.empty()) {
    change_mode(config, o.mode == "realtime" ? RunMode::kRealtime
                        : o.mode == "free"   ? RunMode::kFree
                                             : RunMode::kLockstep);
  }
  if (o.port >= 0) config.tcp.port = static_cast<std::uint16_t>(o.port);
  if (!o.unix_path.empty()) config.tcp.unix_path = o.unix_path;
  if (!o.experiments.empty()) config.experiments.folder = o.experiments;
  if (!o.audit.empty()) config.audit.file = o.audit;
  if (o.command_delay_ticks >= 0) config.setup.command_delay_ticks = o.command_delay_ticks;
  if (config.mode == RunMode::kRealtime && config.setup.command_delay_ticks == 0) {
    throw std::runtime_error(
        "--command-delay-ticks 0: in real time a command holds from the next tick on, 1");
  }
  return config;
}

void print_ready(const ServerOptions& o, const BenchConfig& config, const StreamServer& server,
                 const Transports& transports) {
  if (o.json) {
    const nlohmann::json ready{{"event", "ready"},
                               {"tcp", server.tcp_address()},
                               {"unix", config.tcp.unix_path},
                               {"can", transports.can_names()},
                               {"modbus", transports.modbus_address()},
                               {"mode", name_of(config.mode)},
                               {"bench", config.name}};
    return print_line(ready);
  }
  std::string others;
  for (const std::string& bus : transports.can_names())
    others += " can=" + bus;
  if (config.modbus.enabled) others += " modbus=" + transports.modbus_address();
  print_line(fmt::format("ready tcp={} unix={}{} mode={} bench={}", server.tcp_address(),
                         config.tcp.unix_path, others, name_of(config.mode), config.name));
}

/// In real time every bus must be able to carry its frames.
void check_bus_loads(const ServerOptions& o, const BenchConfig& config) {
  if (config.mode != RunMode::kRealtime) return;
  for (const std::string& overload : bus_overloads(config)) {
    if (!o.allow_overload) throw std::runtime_error(overload + "; --allow-overload starts all the same");
    log::warn("{}", overload);
  }
}

/// The non-empty buckets as [upper edge in us, count].
nlohmann::json lateness_rows(const OctaveHistogram& lateness) {
  nlohmann::json rows = nlohmann::json::array();
  double edge_us = static_cast<double>(OctaveHistogram::kFirstEdgeNs) * 1e-3;
  for (const std::uint64_t count : lateness.buckets()) {
    if (count > 0) rows.push_back({edge_us, count});
    edge_us *= 2.0;
  }
  return rows;
}

/// When the commands came, by axis.
nlohmann::json answer_rows(const Engine& engine) {
  nlohmann::json rows = nlohmann::json::array();
  for (const AnswerClock& clock : engine.answer_clocks())
    rows.push_back(answer_times_json(clock.times()));
  return rows;
}

/// What the device under test was told.
nlohmann::json message_rows(const std::vector<DeviceMessages::Outcome>& outcomes) {
  nlohmann::json rows = nlohmann::json::array();
  for (const DeviceMessages::Outcome& each : outcomes)
    rows.push_back({{"tick", each.tick}, {"text", each.text}, {"problem", each.problem}});
  return rows;
}

void print_verdict(const ServerOptions& o, const Verdict& v, const Engine& engine, DeviceMessages* messages) {
  if (o.json) {
    nlohmann::json verdict{{"event", "verdict"},
                           {"mode", name_of(v.mode)},
                           {"ticks", v.ticks},
                           {"late_ticks", v.late_ticks},
                           {"lateness_p50_us", static_cast<double>(v.lateness.percentile_ns(0.5)) * 1e-3},
                           {"lateness_p99_us", static_cast<double>(v.lateness.percentile_ns(0.99)) * 1e-3},
                           {"worst_lateness_us", static_cast<double>(v.lateness.worst_ns()) * 1e-3},
                           {"lateness_histogram", lateness_rows(v.lateness)},
                           {"exact", v.exact()},
                           {"realtime_valid", v.realtime_valid()},
                           {"gaps", v.gaps},
                           {"state_hash", fmt::format("{:016x}", v.state_hash)},
                           {"recording", v.recording},
                           {"sentence", v.sentence()}};
    if (o.measure_answers) verdict["answers"] = answer_rows(engine);
    if (messages != nullptr) verdict["messages"] = message_rows(messages->outcomes());
    return print_line(verdict);
  }
  print_line(fmt::format("{}; state hash {:016x}", v.sentence(), v.state_hash));
  if (!v.recording.empty()) print_line(fmt::format("recorded in {}", v.recording));
}

RecordingOptions recording_options(const ServerOptions& o, const BenchConfig& config) {
  const double ticks = o.file_s * 1e9 / static_cast<double>(config.setup.period_ns);
  return {
      .file_ticks = o.file_s > 0.0 ? std::max<std::uint64_t>(static_cast<std::uint64_t>(ticks + 0.5), 1) : 0,
      .file_bytes = o.file_mib << 20,
      .chunk_ns = static_cast<std::int64_t>(o.chunk_ms * 1e6),
      .continues_after_errors = true,
      .reserve_bytes = kDiskReserveBytes};
}

/// Throws if the host grants less than real time needs.
void require_realtime(const BenchConfig& config) {
  if (config.mode != RunMode::kRealtime)
    throw std::runtime_error("--require-rt: this run is not in real time");
  std::vector<std::string> notes;
  std::thread([&] { notes = enter_realtime(config.realtime); }).join();
  if (config.realtime.priority <= 0) notes.emplace_back("the bench file asks for no priority");
  if (!notes.empty()) throw std::runtime_error("--require-rt: " + notes.front());
}

/// A signal has ended the repetition of a run.
struct Stopped {
  Tick tick;
};

void repeat_recording(const ServerOptions& o, Bench& bench, const std::function<void()>& before_tick) {
  const MappedSeries series(o.repeat);
  try {
    repeat(series.segments(), bench, {.until = o.until, .before_tick = before_tick});
  } catch (const std::runtime_error& problem) {
    throw std::runtime_error(fmt::format("--repeat: {}: {}", o.repeat, problem.what()));
  }
}

/// Runs the bench as the recording says, and ends the leases of its controllers. Throws.
BeginRun repetition(const ServerOptions& o, const BenchConfig& config, std::optional<Tick> max_ticks,
                    const StopSignal& stop_signal) {
  if (o.repeat.empty()) return {};
  if (config.mode != RunMode::kLockstep)
    throw std::runtime_error("--repeat: time waits for a controller in lockstep only; see --mode");
  if (max_ticks && *max_ticks < o.until) {
    throw std::runtime_error(
        fmt::format("--duration: ends at tick {}, but --until is {}", *max_ticks, o.until));
  }
  if (o.until == 0) {  // nothing has acted then: the run begins as any other, if the recorded one was of it
    Bench bench(config.setup);
    repeat_recording(o, bench, [] {});
    return {};
  }
  return [&o, &stop_signal](Bench& bench, Recorder* recorder) {
    repeat_recording(o, bench, [&bench, &stop_signal, recorder] {
      if (stop_signal.has_come()) throw Stopped{bench.tick()};
      if (recorder != nullptr) recorder->wait_for_room();
    });
    bench.release_leases();
  };
}

std::unique_ptr<Engine> make_engine(const ServerOptions& o, const BenchConfig& config, asio::io_context& io,
                                    const StopSignal& stop_signal) {
  std::optional<Tick> max_ticks;
  if (o.duration_s > 0.0) {
    max_ticks = static_cast<Tick>(o.duration_s * 1e9 / static_cast<double>(config.setup.period_ns) + 0.5);
  }
  const BeginRun begin = repetition(o, config, max_ticks, stop_signal);
  std::unique_ptr<Recorder> recorder;
  if (!o.record.empty()) {
    recorder = std::make_unique<Recorder>(o.record, config, std::initializer_list<RecordingAttachment>{},
                                          recording_options(o, config));
  }
  return config.mode == RunMode::kLockstep
             ? make_lockstep_engine(config, std::move(recorder), io, max_ticks, begin)
             : make_threaded_engine(config, std::move(recorder), io, max_ticks);
}

/// Throws if the file is no state of this bench.
void go_to_saved_state(Engine& engine, const std::string& file) {
  const FileText saved = read_file(file, engine.state_size());
  if (!saved.why_not.empty()) throw std::runtime_error(fmt::format("--from: {} {}", file, saved.why_not));
  if (!engine.restore(std::as_bytes(std::span(saved.text)))) {
    throw std::runtime_error(
        fmt::format("--from: {} is no state of the bench {}", file, engine.config().name));
  }
}

/// Shows the progress of a run of known length twice a second if standard error is a terminal.
asio::awaitable<void> show_progress(const Engine& engine, double duration_s) {
  ServerTimer timer(co_await asio::this_coro::executor);
  const double period_s = static_cast<double>(engine.config().setup.period_ns) * 1e-9;
  for (;;) {
    timer.expires_after(std::chrono::milliseconds(500));
    co_await timer.async_wait(asio::use_awaitable);
    fmt::print(stderr, "\r{:.1f} of {:.1f} s ", static_cast<double>(engine.tick()) * period_s, duration_s);
    std::fflush(stderr);
  }
}

/// At each SIGHUP reads the bench file again and applies only its tokens and log level. Opens the audit log
/// again, so that a moved file is replaced by a new one.
asio::awaitable<void> reload_on_hangup(asio::signal_set& hangups, const ServerOptions& o,
                                       StreamServer& server, Audit* audit) {
  for (;;) {
    co_await hangups.async_wait(asio::use_awaitable);
    std::string result = "done";
    std::vector<AuditDetail> details{{"file", o.config}};
    try {
      BenchConfig now = configure(o);
      details.emplace_back("configuration_hash", fmt::format("{:016x}", configuration_hash(now)));
      server.replace_grants(std::move(now.tcp));
      log::set_level(now.log_level);
      log::info("SIGHUP: tokens and log level are those of {} now", o.config);
    } catch (const std::exception& error) {
      result = error.what();
      log::error("SIGHUP: everything stays as it is: {}", result);
    }
    if (audit == nullptr) continue;
    if (!audit->reopen()) log::error("SIGHUP: the audit log cannot be opened again and stays the old one");
    audit->note({.name = "reload", .result = result, .details = std::move(details)});
  }
}

void note_start(Audit& audit, const Engine& engine) {
  const BenchConfig& config = engine.config();
  audit.note({.name = "start",
              .details = {{"bench", config.name},
                          {"mode", std::string(name_of(config.mode))},
                          {"configuration_hash", fmt::format("{:016x}", engine.configuration_hash())},
                          {"build_id", std::string(build_id())}}});
  if (engine.recorder() != nullptr) {
    audit.note({.name = "recording_started", .details = {{"file", engine.recorder()->file()}}});
  }
}

void note_end(Audit& audit, const Engine& engine, const Verdict& verdict) {
  if (engine.recorder() != nullptr) {
    audit.note(
        {.name = "recording_stopped",
         .details = {{"file", verdict.recording}, {"gaps", verdict.gaps}, {"remarks", verdict.remarks}}});
  }
  audit.note({.name = "stop", .details = {{"ticks", verdict.ticks}, {"late_ticks", verdict.late_ticks}}});
}

void print_checked(const ServerOptions& o, const BenchConfig& config) {
  if (o.json) {
    const nlohmann::json checked{{"event", "checked"},
                                 {"bench", config.name},
                                 {"axes", config.axes.size()},
                                 {"mode", name_of(config.mode)}};
    return print_line(checked);
  }
  print_line(fmt::format("{}: no problems; bench {}, {} {}, {} mode", o.config, config.name,
                         config.axes.size(), config.axes.size() == 1 ? "axis" : "axes",
                         name_of(config.mode)));
}

int exit_code(const ServerOptions& o, const Verdict& verdict) {
  if (verdict.gaps > 0) return kFailed;
  const bool too_late =
      o.fail_on_late >= 0 && verdict.late_ticks > static_cast<std::uint64_t>(o.fail_on_late);
  return too_late ? kTooLate : kOk;
}

int serve(const ServerOptions& o, const BenchConfig& config) {
  log::set_level(config.log_level);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  asio::io_context io(1);
  std::optional<StopSignal> stop_signal;
  stop_signal.emplace(io, [&io] { io.stop(); });
  check_bus_loads(o, config);
  if (o.require_realtime) require_realtime(config);
  // Before the recording: a port in use must not leave a recording behind.
  StreamServer server(io, config.tcp, config.tls);
  Transports transports(io, config);
  std::optional<DeviceMessages> messages;
  if (!o.messages.empty()) {
    messages.emplace(read_messages(o.messages, config), o.lines,
                     [&transports](std::size_t bus, const can::Frame& frame) {
                       return transports.send_frame(bus, frame);
                     });
  }
  std::unique_ptr<Audit> audit;
  if (!config.audit.file.empty()) audit = std::make_unique<Audit>(config.audit);
  std::unique_ptr<Experiments> experiments;
  if (!config.experiments.folder.empty()) experiments = std::make_unique<Experiments>(io, config);
  const std::unique_ptr<Engine> engine = make_engine(o, config, io, *stop_signal);
  if (!o.from.empty()) go_to_saved_state(*engine, o.from);
  if (o.measure_answers) engine->measure_answers();
  if (messages) messages->serve(*engine);
  if (audit) audit->watch(*engine);
  if (audit) note_start(*audit, *engine);
  server.serve(
      *engine, [&transports] { return transports.reports(); }, experiments.get(), audit.get());
  asio::signal_set hangups(io, SIGHUP);
  asio::co_spawn(io, reload_on_hangup(hangups, o, server, audit.get()), asio::detached);
  transports.serve(*engine, audit.get());
  engine->on_end = [&io] { io.stop(); };
  for (const std::string& note : engine->notes())
    log::warn("{}", note);
  print_ready(o, config, server, transports);
  if (!notify_service_manager("READY=1")) log::warn("the service manager did not take READY=1");
  if (o.duration_s > 0.0 && ::isatty(STDERR_FILENO) != 0) {
    asio::co_spawn(io, show_progress(*engine, o.duration_s), asio::detached);
  }
  std::optional<Supervisor> supervisor;
  supervisor.emplace(io, engine->watch(), config.mode == RunMode::kRealtime);
  end_without_memory(kFailed);
  bool broken = false;
  try {
    run_io(io, std::chrono::microseconds(o.spin_us));
  } catch (const std::exception& error) {
    log::critical(fmt::format("the run ends: {}", error.what()));
    broken = true;
  }
  if (::isatty(STDERR_FILENO) != 0) fmt::print(stderr, "\r{:40}\r", "");
  stop_signal.reset();
  notify_service_manager("STOPPING=1");
  supervisor.reset();  // ticks and I/O stop from here on
  const Verdict verdict = engine->stop();
  experiments.reset();
  transports.close();
  server.close();
  if (audit) note_end(*audit, *engine, verdict);
  print_verdict(o, verdict, *engine, messages ? &*messages : nullptr);
  return broken ? kFailed : exit_code(o, verdict);
}

int use_bench(const ServerOptions& o) {
  const BenchConfig config = configure(o);
  if (!o.print.empty()) {
    fmt::print("{}", interface_text(config, o.print, o.bus));
  } else if (o.check_config) {
    if (!o.messages.empty()) read_messages(o.messages, config);
    print_checked(o, config);
  } else {
    return serve(o, config);
  }
  return kOk;
}

int run(int argc, char** argv) {
  ServerOptions o;
  if (const std::optional<bool> done = read_command_line(argc, argv, o)) return *done ? kOk : kUnusable;
  const bool json_log = o.log_format == "json";
  if (json_log) log::write_json();
  try {
    return o.replay.empty() ? use_bench(o) : replay_command(o.replay, o.json);
  } catch (const Stopped& stopped) {
    log::error("stopped at tick {}, before the recorded run was repeated", stopped.tick);
    return kFailed;
  } catch (const std::exception& error) {
    if (!json_log) throw;
    fmt::print(stderr, "{}\n", json_log_line(std::chrono::system_clock::now(), "critical", error.what()));
    return kUnusable;
  }
}

}  // namespace
}  // namespace drivebench

int main(int argc, char** argv) {
  drivebench::end_without_memory(drivebench::kUnusable);
  drivebench::use_small_stacks();
  google::protobuf::SetLogHandler(nullptr);  // a peer could fill the log with texts that are not UTF-8
  try {
    if (drivebench::force_arithmetic()) {
      drivebench::log::warn("a library has changed how this program rounds; set back");
    }
    return drivebench::run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return drivebench::kUnusable;
  }
}
