#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "server/bench.hpp"

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
  std::uint16_t port = 7300;  ///< 0: chosen by the system
  std::string unix_path;      ///< empty: no unix socket
  std::string token;          ///< what Hello must carry, read from a file of its own; empty: none
  std::uint32_t max_sessions = 256;
};

/// A load torque that starts by itself.
struct LoadEvent {
  Tick tick = 0;
  LoadChange change{};
};

/// What the bench file says of an axis beside its physics.
struct AxisConfig {
  std::string name;
  std::string motor;             ///< name of the motor, for people
  std::vector<LoadEvent> loads;  ///< sorted by tick
};

/// Everything that a bench file says.
struct BenchConfig {
  std::string name;
  RunMode mode = RunMode::kLockstep;
  BenchSetup setup;  ///< what the physics depend on; setup.axes and axes run in parallel
  std::vector<AxisConfig> axes;
  RealtimeConfig realtime;
  TcpConfig tcp;
};

/// One thing wrong with a configuration, with the place it was found at.
struct ConfigProblem {
  std::string file;
  int line = 0;
  std::string key;  ///< full path of the key, for example "axis.machine.rotor_resistance_ohm"
  std::string rule;
};

/// All that is wrong with a configuration, at once; what() is the list as a user reads it, "file:line: key
/// rule" lines.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<ConfigProblem> problems);
  const std::vector<ConfigProblem>& problems() const noexcept { return problems_; }

 private:
  std::vector<ConfigProblem> problems_;
};

/// Reads a bench file and the motor files that it names (relative to it). Throws ConfigError.
BenchConfig load_config(const std::filesystem::path& file);

/// Reads a bench from text; `name` stands for the file in messages, `folder` is where the files that it names
/// are looked for. Without a folder it may name none.
BenchConfig parse_config(std::string_view text, const std::string& name, const std::filesystem::path& folder);

/// The configuration as one TOML text that needs no other file and reads back equal, bit for bit; all but the
/// token, which it does not hold, and an address that would need one.
std::string to_toml(const BenchConfig& config);

/// The part of to_toml() that the samples depend on: timing, seed, watchdog and lease, and of each axis its
/// safe action, parameters and loads. Neither names nor mode, pacer, addresses.
std::string physics_toml(const BenchConfig& config);

/// Hash of physics_toml(): two benches with the same hash answer the same inputs with the same samples.
std::uint64_t configuration_hash(const BenchConfig& config);

std::string_view name_of(RunMode mode) noexcept;
std::string_view name_of(PacerKind pacer) noexcept;
std::string_view name_of(SafeAction action) noexcept;

/// An IPv4 or IPv6 address as text, or "localhost". Strict: neither "127.1" nor "0x7f000001" nor "0" is one.
bool is_address(const std::string& text) noexcept;
/// Whether such an address can be reached from this computer only.
bool is_loopback(const std::string& address) noexcept;

/// Limits that a configuration keeps.
inline constexpr std::size_t kMaxAxes = 64;
inline constexpr std::size_t kMaxLoads =
    Bench::kMaxScheduled / 2;  ///< of all axes; leaves room for the clients

}  // namespace drivebench
