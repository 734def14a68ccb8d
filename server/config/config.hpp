#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/profile.hpp"
#include "protocols/document.hpp"
#include "server/bench/bench.hpp"
#include "server/config/grants.hpp"

namespace drivebench {

/// How time enters: paced by the clock, by the commands of the controllers, or not at all.
enum class RunMode { kRealtime, kLockstep, kFree };

/// How the real-time tick waits: by the kernel's timer, or with the last microseconds spent polling the
/// clock.
enum class PacerKind { kSleep, kSleepSpin };

/// Section [realtime].
struct RealtimeConfig {
  PacerKind pacer = PacerKind::kSleepSpin;
  std::int64_t max_lateness_ns = 100'000'000;  ///< beyond it the bench faults and resynchronises
  int cpu = -1;                                ///< pins the tick to this CPU; -1: not pinned
  int priority = 80;                           ///< SCHED_FIFO, when permitted; 0: ordinary scheduling
};

/// Section [tcp]: where clients connect.
struct TcpConfig {
  std::string address = "127.0.0.1";
  std::uint16_t port = 7300;    ///< 0: chosen by the system
  std::string unix_path;        ///< empty: no unix socket
  bool asks_for_token = false;  ///< Hello must carry one of the tokens in the tokens file
  std::vector<Grant> grants;    ///< what the tokens file says
  std::uint32_t max_sessions = 256;
};

/// What carries the frames of a [[can]] section.
enum class CanBackend { kSocketCan, kUdpMulticast, kSlcan, kSocketcand };

/// Section [[can]]: a bus that controllers share with the bench.
struct CanConfig {
  CanBackend backend = CanBackend::kUdpMulticast;
  /// socketcan: name of the interface; udp_multicast: the group; slcan: the absolute path of a serial device,
  /// with "@BAUD" if need be, "pty:PATH" (a terminal made at this absolute path) or "tcp:ADDRESS:PORT"
  /// (listens; an IPv6 address may stand in brackets); socketcand: the address to listen on. What listens,
  /// does so on a loopback address: neither protocol knows a password.
  std::string channel = "239.74.163.2";
  std::uint16_t port = 43113;  ///< udp_multicast and socketcand; 0: chosen by the system (socketcand only)
  bool required = true;        ///< whether the bench may start without it
  can::Profile profile;
  std::int64_t bit_rate = 1'000'000;
  std::int64_t data_bit_rate = 5'000'000;  ///< FD: of the data phase
  std::int64_t sample_every_ticks = 1;     ///< real time: a sample frame every so many ticks
  std::int64_t state_every_ticks = 80;
  bool edges = false;               ///< FD: sends the times of all encoder edges
  std::int64_t heartbeat_ms = 100;  ///< wall time; 0: none
  /// Lets the lease of a controller lapse that stops its heartbeat, once it has sent one.
  std::int64_t controller_timeout_ms = 1000;
  /// Lockstep: so long in wall time may the owner of an axis be silent before it loses its lease; 0: for
  /// ever.
  std::int64_t idle_timeout_ms = 10'000;
};

/// Section [modbus].
struct ModbusConfig {
  bool enabled = false;  ///< the section exists
  std::string address = "127.0.0.1";
  std::uint16_t port = 1502;  ///< 0: chosen by the system
  bool allow_writes = false;
  bool unprotected = false;  ///< writes may come from other computers, although Modbus knows no password
  std::uint32_t max_connections = 32;
  std::uint32_t requests_per_s = 2000;  ///< per peer address, sustained; 0: no limit
  std::int64_t frame_timeout_ms = 500;
  std::int64_t idle_timeout_ms = 10'000;  ///< an owner that says nothing for so long loses its lease
};

/// Section [experiments]: what users may run on benches of their own.
struct ExperimentsConfig {
  std::filesystem::path folder;     ///< where they are kept; empty: there are none
  std::uint32_t queue_length = 32;  ///< waiting ones
  double longest_s = 120.0;         ///< of plant time
  std::uint64_t table_rows = 10'000'000;
  std::uint32_t kept = 50;  ///< ended ones; the oldest goes first
};

/// Section [tls]: clients on TCP speak TLS.
struct TlsConfig {
  std::filesystem::path certificate;  ///< chain in PEM; empty: they speak plainly
  std::filesystem::path key;          ///< that nobody but its owner may read
  std::filesystem::path client_ca;    ///< who signs the certificates of clients; empty: they need none
  std::filesystem::path client_crl;   ///< those of them that hold no more; empty: none
};

/// What happens when the audit log cannot be written.
enum class AuditFailure {
  kContinue,  ///< the run goes on, what is missing is counted
  kSafe,      ///< every controller loses its axis, which goes to its safe action
};

/// Section [audit]: who did what, as JSON lines.
struct AuditConfig {
  std::filesystem::path file;  ///< empty: none is kept
  AuditFailure on_failure = AuditFailure::kContinue;
};

/// Section [log]: what goes to standard error.
enum class LogLevel { kDebug, kInfo, kWarn, kError, kOff };

/// Something that happens to an axis by itself: a load, a new parameter value, a fault, a bump.
struct AxisEvent {
  Tick tick = 0;
  Action action;
};

/// What the bench file says of an axis beside its physics.
struct AxisConfig {
  std::string name;
  std::string motor;              ///< name of the motor, for people
  std::uint32_t can_node = 1;     ///< node id on every bus; its number from 1 on unless it says otherwise
  std::vector<AxisEvent> events;  ///< in the order of in_order()
};

/// Everything that a bench file says.
struct BenchConfig {
  std::string name;
  RunMode mode = RunMode::kLockstep;
  BenchSetup setup;  ///< what the physics depend on; setup.axes and axes run in parallel
  std::vector<AxisConfig> axes;
  RealtimeConfig realtime;
  TcpConfig tcp;
  std::vector<CanConfig> can;
  ModbusConfig modbus;
  ExperimentsConfig experiments;
  TlsConfig tls;
  AuditConfig audit;
  LogLevel log_level = LogLevel::kInfo;
};

/// Reads a bench file and the motor files that it names (relative to it). Throws ConfigError.
BenchConfig load_config(const std::filesystem::path& file);

/// Reads a bench from text; `name` stands for the file in messages, `folder` is where the files that it names
/// are looked for. Without a folder it may name none.
BenchConfig parse_config(std::string_view text, const std::string& name, const std::filesystem::path& folder);

/// Good commands in a row that arm an axis, unless the bench file says otherwise: 10 in real time; 1 where
/// every tick has its command.
constexpr std::int64_t default_arming_commands(RunMode mode) noexcept {
  return mode == RunMode::kRealtime ? 10 : 1;
}

/// Runs the bench in another mode than its file says; what has a default by mode gets the new one.
void change_mode(BenchConfig& config, RunMode mode) noexcept;

/// The configuration as one TOML text that needs no other file and reads back equal, bit for bit; all but the
/// tokens, which it does not hold, an address that would need them, tls, experiments, audit and log.
std::string to_toml(const BenchConfig& config);

/// The part of to_toml() that the samples depend on: timing, seed, watchdog and lease, and of each axis its
/// safe action, parameters, curves and events. Neither names nor mode, pacer, addresses.
std::string physics_toml(const BenchConfig& config);

/// Hash of physics_toml(): two benches with the same hash answer the same inputs with the same samples.
std::uint64_t configuration_hash(const BenchConfig& config);

std::string_view name_of(RunMode mode) noexcept;
std::string_view name_of(PacerKind pacer) noexcept;
std::string_view name_of(SafeAction action) noexcept;
std::string_view name_of(CanBackend backend) noexcept;

/// Events as they follow each other: by tick; within one loads, parameters, faults that end, faults that
/// begin, bumps.
std::vector<AxisEvent> in_order(std::vector<AxisEvent> events);

/// An IPv4 or IPv6 address as text, or "localhost". Strict: neither "127.1" nor "0x7f000001" nor "0" is one.
bool is_address(const std::string& text) noexcept;
/// Whether such an address can be reached from this computer only.
bool is_loopback(const std::string& address) noexcept;
/// Whether such an address stands for a multicast group.
bool is_multicast(const std::string& address) noexcept;

/// Limits that a configuration keeps.
inline constexpr std::size_t kMaxAxes = 64;
inline constexpr std::size_t kMaxCanBuses = 8;
inline constexpr std::size_t kMaxAxisEvents =
    Bench::kMaxScheduled / 2;  ///< of all axes; leaves room for the clients

}  // namespace drivebench
