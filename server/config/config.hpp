#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/backends.hpp"
#include "protocols/can/profile.hpp"
#include "protocols/document.hpp"
#include "server/bench/bench.hpp"
#include "server/bench/change_requests.hpp"
#include "server/config/grants.hpp"
#include "server/host/logging/log_level.hpp"

namespace drivebench {

/// The pace of ticks: the clock, the commands of the controllers, or none.
enum class RunMode { kRealtime, kLockstep, kFree };

/// The wait for a real-time tick: the kernel's timer, or the timer and polling of the clock for the last
/// microseconds.
enum class PacerKind { kSleep, kSleepSpin };

/// Section [realtime].
struct RealtimeConfig {
  PacerKind pacer = PacerKind::kSleepSpin;
  std::int64_t max_lateness_ns = 100'000'000;  ///< beyond it the bench faults and resynchronises
  int cpu = -1;                                ///< pins the tick to this CPU; -1: not pinned
  int priority = 80;                           ///< SCHED_FIFO, when permitted; 0: ordinary scheduling
};

/// Section [tcp]: the addresses for clients.
struct TcpConfig {
  std::string address = "127.0.0.1";
  std::uint16_t port = 7300;    ///< 0: chosen by the system
  std::string unix_path;        ///< empty: no unix socket
  bool asks_for_token = false;  ///< Hello must carry one of the tokens in the tokens file
  std::vector<Grant> grants;    ///< the entries of the tokens file
  std::uint32_t max_sessions = 256;
  std::optional<std::uint32_t> max_sessions_of_address;  ///< none: sessions_of_address() says how many
};

/// Section [[can]]: a bus that controllers share with the bench. The meaning of channel and port depends on
/// the back end. A back end that listens does so on a loopback address, because no back end has a password.
struct CanConfig {
  can::Backend backend = can::Backend::kUdpMulticast;
  std::string channel{can::row_of(can::Backend::kUdpMulticast).default_channel};
  std::uint16_t port = can::row_of(can::Backend::kUdpMulticast).default_port;
  bool required = true;  ///< whether the bench may start without it
  can::Profile profile;
  std::int64_t bit_rate = 1'000'000;
  std::int64_t data_bit_rate = 5'000'000;  ///< FD: of the data phase
  std::int64_t sample_every_ticks = 1;     ///< real time: ticks between sample frames
  std::int64_t state_every_ticks = 80;
  bool edges = false;               ///< FD: sends the times of all encoder edges
  std::int64_t heartbeat_ms = 100;  ///< wall time; 0: none
  /// A controller that has sent heartbeats loses its lease after this time without one.
  std::int64_t controller_timeout_ms = 1000;
  /// Lockstep: a controller that is silent for this wall time loses its lease; 0: never.
  std::int64_t idle_timeout_ms = 10'000;
};

/// Section [modbus].
struct ModbusConfig {
  bool enabled = false;  ///< the section exists
  std::string address = "127.0.0.1";
  std::uint16_t port = 1502;  ///< 0: chosen by the system
  bool allow_writes = false;
  bool unprotected = false;  ///< allows writes from other computers, although Modbus has no password
  std::uint32_t max_connections = 32;
  std::uint32_t requests_per_s = 2000;  ///< per peer address, sustained; 0: no limit
  std::int64_t frame_timeout_ms = 500;
  std::int64_t idle_timeout_ms = 10'000;  ///< a controller that is silent for this time loses its lease
};

/// Section [experiments]: limits of the experiments that clients run.
struct ExperimentsConfig {
  std::filesystem::path folder;     ///< keeps the experiments; empty: no experiments
  std::uint32_t queue_length = 32;  ///< the most waiting experiments
  double longest_s = 120.0;         ///< the longest experiment [s of plant time]
  std::uint64_t table_rows = 10'000'000;
  std::uint32_t kept = 50;  ///< the most ended experiments; the server deletes the oldest first
};

/// Section [tls]: clients on TCP speak TLS.
struct TlsConfig {
  std::filesystem::path certificate;  ///< chain in PEM; empty: no TLS
  std::filesystem::path key;          ///< readable by its owner only
  std::filesystem::path client_ca;    ///< signs the certificates of clients; empty: clients need none
  std::filesystem::path client_crl;   ///< the revoked client certificates; empty: none
};

/// The reaction to a failed write of the audit log.
enum class AuditFailure {
  kContinue,  ///< the run goes on and counts the missing lines
  kSafe,      ///< every controller loses its lease, and every axis takes its safe action
};

/// Section [audit]: the log of the actions of clients, as JSON lines.
struct AuditConfig {
  std::filesystem::path file;  ///< empty: no audit log
  AuditFailure on_failure = AuditFailure::kContinue;
};

/// A change of an axis that the bench file sets: a load, a parameter value, a fault, a bump.
struct AxisEvent {
  Tick tick = 0;  ///< of the change, or the ticks between its trigger and it
  Action action;
  std::optional<Trigger> trigger{};
};

/// The settings of an axis beside its physics.
struct AxisConfig {
  std::string name;
  std::string motor;              ///< name of the motor, for display
  std::uint32_t can_node = 1;     ///< node id on every bus
  std::vector<AxisEvent> events;  ///< in the order of in_order()
};

/// The content of a bench file.
struct BenchConfig {
  std::string name;
  RunMode mode = RunMode::kLockstep;
  BenchSetup setup;  ///< the settings that affect samples; setup.axes[i] and axes[i] are the same axis
  std::vector<AxisConfig> axes;
  RealtimeConfig realtime;
  TcpConfig tcp;
  std::vector<CanConfig> can;
  ModbusConfig modbus;
  ExperimentsConfig experiments;
  TlsConfig tls;
  AuditConfig audit;
  LogLevel log_level =
      LogLevel::kInfo;  ///< section [log]: the least severe level that goes to standard error
};

/// Reads a bench file and the motor files that it names (relative to it). Throws ConfigError.
BenchConfig load_config(const std::filesystem::path& file);

/// Reads a bench from text. Messages show `name` as the file name. Names of other files are relative to
/// `folder`; without a folder the text must not name any.
BenchConfig parse_config(std::string_view text, const std::string& name, const std::filesystem::path& folder);

/// The default number of accepted commands in a row that arm an axis: 10 in real time, 1 in the other modes,
/// where every tick has its command.
constexpr std::int64_t default_arming_commands(RunMode mode) noexcept {
  return mode == RunMode::kRealtime ? 10 : 1;
}

/// Changes the mode; a value that is the default of the old mode becomes the default of the new one. Real
/// time sets the command delay to 1 tick.
void change_mode(BenchConfig& config, RunMode mode) noexcept;

/// The configuration as one TOML text that names no other file and reads back equal, bit for bit. It leaves
/// out the tokens, an address that needs them, tls, experiments, audit and log.
std::string to_toml(const BenchConfig& config);

/// The part of to_toml() that the samples depend on: timing, seed, watchdog, lease, and for each axis safe
/// action, parameters, curves and events; without names, mode, pacer and addresses.
std::string physics_toml(const BenchConfig& config);

std::vector<std::string> axis_names(const BenchConfig& config);

/// Gives the bench the events of the configuration, as inputs for later ticks or behind a trigger.
void schedule_events(const BenchConfig& config, Bench& bench);

/// Only those that wait for a condition: the others are inputs of a recording that the bench repeats.
void await_events(const BenchConfig& config, Bench& bench);

/// An event of the configuration as people read it, and what has come of it.
struct EventState {
  std::size_t axis;
  std::string text;           ///< for example "fault open_phase = 2 when speed_rad_s > 100 for 40 ticks"
  std::optional<Tick> acted;  ///< the tick in which it acted; none: not yet
};
/// The events in the order of the axes, on a bench to which schedule_events() gave them.
std::vector<EventState> event_states(const BenchConfig& config, const Bench& bench);

/// An axis for requests that change it.
ChangeView change_view(const BenchConfig& config, std::size_t axis, const AxisParameters& in_force,
                       Tick tick) noexcept;

/// The reason for people why a request for this axis was refused, which has these latched faults.
std::string sentence_of(Refused why, const BenchConfig& config, std::size_t axis, std::uint64_t latched);

/// The hash of physics_toml(): benches with the same hash give the same samples for the same inputs.
std::uint64_t configuration_hash(const BenchConfig& config);

std::string_view name_of(RunMode mode) noexcept;
std::string_view name_of(PacerKind pacer) noexcept;
std::string_view name_of(SafeAction action) noexcept;

/// Sorts events by tick; within a tick loads, parameters, faults that end, faults that begin, bumps. Those
/// with a trigger come last.
std::vector<AxisEvent> in_order(std::vector<AxisEvent> events);

/// Whether the text is an IPv4 or IPv6 address or "localhost". Short forms such as "127.1", "0x7f000001" and
/// "0" are not.
bool is_address(const std::string& text) noexcept;
/// Whether only this computer can reach the address.
bool is_loopback(const std::string& address) noexcept;
/// The most sessions of one address. Unless configured, half of all; on a loopback address, where all clients
/// are of this computer, all.
std::uint32_t sessions_of_address(const TcpConfig& tcp) noexcept;
/// Whether the address is that of a multicast group.
bool is_multicast(const std::string& address) noexcept;

/// Limits of a configuration.
inline constexpr std::size_t kMaxAxes = 64;
inline constexpr std::size_t kMaxCanBuses = 8;
inline constexpr std::size_t kMaxAxisEvents =
    Bench::kMaxScheduled / 2;  ///< of all axes; the other half is for clients

}  // namespace drivebench
