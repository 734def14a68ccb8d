#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <system_error>

#include "plant/parameters/parameters.hpp"
#include "server/config/config.hpp"

namespace drivebench::test {

namespace fs = std::filesystem;

inline const fs::path kConfigs = DRIVEBENCH_CONFIGS;

inline std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// A folder of its own for the files of a test.
class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "drivebench-config-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no folder for the test");
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return path_ / name;
  }

 private:
  fs::path path_;
};

/// A bench that needs no other file; the tests name its line numbers.
inline const std::string kBench =
    "[bench]\n"                        // 1
    "name = \"b\"\n"                   // 2
    "mode = \"lockstep\"\n"            // 3
    "period_us = 125\n"                // 4
    "[[axis]]\n"                       // 5
    "name = \"x\"\n"                   // 6
    "[axis.machine]\n"                 // 7
    "pole_pairs = 3\n"                 // 8
    "stator_resistance_ohm = 1.7\n"    // 9
    "rotor_resistance_ohm = 3.9\n"     // 10
    "stator_inductance_h = 0.014\n"    // 11
    "rotor_inductance_h = 0.014\n"     // 12
    "mutual_inductance_h = 0.0117\n"   // 13
    "[axis.mechanics]\n"               // 14
    "inertia_kgm2 = 1.1e-4\n"          // 15
    "[axis.amplifier]\n"               // 16
    "voltage_limit_v = 80\n"           // 17
    "over_current_a = 6.0\n"           // 18
    "[axis.encoder]\n"                 // 19
    "counts_per_revolution = 2000\n";  // 20

/// A second axis on the shaft of the first, from line 21 on.
inline const std::string kBrake = [] {
  std::string text = "[[axis]]\nname = \"brake\"\nshares_shaft_with = \"x\"\n" +
                     kBench.substr(kBench.find("[axis.machine]"));
  return text.replace(text.find("[axis.mechanics]\ninertia_kgm2 = 1.1e-4\n"), 39, "");
}();

/// kBench with one piece of text exchanged.
inline std::string with(const std::string& piece, const std::string& other) {
  std::string text = kBench;
  const std::size_t at = text.find(piece);
  if (at == std::string::npos) throw std::logic_error("kBench has no " + piece);
  return text.replace(at, piece.size(), other);
}

inline BenchConfig parse(const std::string& text) {
  return parse_config(text, "b.toml", "/nonexistent");
}

/// All problems as "line key rule" lines.
inline std::string problems_of(const std::string& text, const fs::path& folder = "/nonexistent") {
  try {
    parse_config(text, "b.toml", folder);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "none";
}

inline void expect_equal(const CanConfig& x, const CanConfig& y) {
  EXPECT_EQ(x.backend, y.backend);
  EXPECT_EQ(x.channel, y.channel);
  EXPECT_EQ(x.port, y.port);
  EXPECT_EQ(x.required, y.required);
  EXPECT_EQ(x.profile.fd, y.profile.fd);
  EXPECT_EQ(x.profile.extended, y.profile.extended);
  EXPECT_EQ(x.profile.id_set, y.profile.id_set);
  EXPECT_EQ(x.profile.base_ids, y.profile.base_ids);
  const auto units = [](const can::Profile& p) {
    return std::bit_cast<std::array<std::uint64_t, 5>>(std::array{
        p.current_unit_a, p.voltage_unit_v, p.bus_voltage_unit_v, p.speed_unit_rad_s, p.edge_time_unit_s});
  };
  EXPECT_EQ(units(x.profile), units(y.profile));
  EXPECT_EQ(x.bit_rate, y.bit_rate);
  EXPECT_EQ(x.data_bit_rate, y.data_bit_rate);
  EXPECT_EQ(x.sample_every_ticks, y.sample_every_ticks);
  EXPECT_EQ(x.state_every_ticks, y.state_every_ticks);
  EXPECT_EQ(x.edges, y.edges);
  EXPECT_EQ(x.heartbeat_ms, y.heartbeat_ms);
  EXPECT_EQ(x.controller_timeout_ms, y.controller_timeout_ms);
  EXPECT_EQ(x.idle_timeout_ms, y.idle_timeout_ms);
}

inline void expect_equal(const ModbusConfig& x, const ModbusConfig& y) {
  EXPECT_EQ(x.enabled, y.enabled);
  EXPECT_EQ(x.address, y.address);
  EXPECT_EQ(x.port, y.port);
  EXPECT_EQ(x.allow_writes, y.allow_writes);
  EXPECT_EQ(x.unprotected, y.unprotected);
  EXPECT_EQ(x.max_connections, y.max_connections);
  EXPECT_EQ(x.requests_per_s, y.requests_per_s);
  EXPECT_EQ(x.frame_timeout_ms, y.frame_timeout_ms);
  EXPECT_EQ(x.idle_timeout_ms, y.idle_timeout_ms);
}

inline void expect_equal(const std::vector<CurvePoint>& x, const std::vector<CurvePoint>& y) {
  ASSERT_EQ(x.size(), y.size());
  for (std::size_t i = 0; i < x.size(); ++i)
    EXPECT_EQ(std::memcmp(&x[i], &y[i], sizeof(CurvePoint)), 0) << "point " << i;
}

inline void expect_equal(const std::vector<AxisEvent>& x, const std::vector<AxisEvent>& y) {
  ASSERT_EQ(x.size(), y.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const PackedInput a = pack({.tick = x[i].tick, .action = x[i].action});
    const PackedInput b = pack({.tick = y[i].tick, .action = y[i].action});
    EXPECT_EQ(std::memcmp(&a, &b, sizeof(a)), 0) << "event " << i << " at tick " << x[i].tick;
    ASSERT_EQ(x[i].trigger.has_value(), y[i].trigger.has_value()) << "event " << i;
    if (!x[i].trigger) continue;
    EXPECT_EQ(x[i].trigger->axis, y[i].trigger->axis) << "event " << i;
    EXPECT_EQ(x[i].trigger->for_ticks, y[i].trigger->for_ticks) << "event " << i;
    EXPECT_EQ(text_of(x[i].trigger->condition), text_of(y[i].trigger->condition)) << "event " << i;
  }
}

/// Everything but token and files, bit for bit.
inline void expect_equal(const BenchConfig& x, const BenchConfig& y) {
  EXPECT_EQ(x.name, y.name);
  EXPECT_EQ(x.mode, y.mode);
  EXPECT_EQ(x.setup.period_ns, y.setup.period_ns);
  EXPECT_EQ(x.setup.substeps, y.setup.substeps);
  EXPECT_EQ(x.setup.seed, y.setup.seed);
  EXPECT_EQ(x.setup.command_delay_ticks, y.setup.command_delay_ticks);
  EXPECT_EQ(x.setup.arming_commands, y.setup.arming_commands);
  EXPECT_EQ(x.setup.watchdog_ticks, y.setup.watchdog_ticks);
  EXPECT_EQ(x.setup.lease_ticks, y.setup.lease_ticks);
  EXPECT_EQ(x.realtime.pacer, y.realtime.pacer);
  EXPECT_EQ(x.realtime.max_lateness_ns, y.realtime.max_lateness_ns);
  EXPECT_EQ(x.realtime.cpu, y.realtime.cpu);
  EXPECT_EQ(x.realtime.priority, y.realtime.priority);
  EXPECT_EQ(x.tcp.address, y.tcp.address);
  EXPECT_EQ(x.tcp.port, y.tcp.port);
  EXPECT_EQ(x.tcp.unix_path, y.tcp.unix_path);
  EXPECT_EQ(x.tcp.max_sessions, y.tcp.max_sessions);
  EXPECT_EQ(x.tcp.max_sessions_of_address, y.tcp.max_sessions_of_address);
  ASSERT_EQ(x.can.size(), y.can.size());
  for (std::size_t i = 0; i < x.can.size(); ++i)
    expect_equal(x.can[i], y.can[i]);
  expect_equal(x.modbus, y.modbus);
  ASSERT_EQ(x.axes.size(), y.axes.size());
  ASSERT_EQ(x.setup.axes.size(), y.setup.axes.size());
  for (std::size_t i = 0; i < x.axes.size(); ++i) {
    EXPECT_EQ(x.axes[i].name, y.axes[i].name);
    EXPECT_EQ(x.axes[i].motor, y.axes[i].motor);
    EXPECT_EQ(x.axes[i].can_node, y.axes[i].can_node);
    EXPECT_EQ(x.setup.axes[i].on_link_loss, y.setup.axes[i].on_link_loss);
    EXPECT_EQ(x.setup.axes[i].quick_stop_ticks, y.setup.axes[i].quick_stop_ticks);
    EXPECT_EQ(x.setup.axes[i].rules.on_excess, y.setup.axes[i].rules.on_excess);
    EXPECT_EQ(x.setup.axes[i].rules.slew_per_s, y.setup.axes[i].rules.slew_per_s);
    const AxisParameters& p = x.setup.axes[i].parameters;
    const AxisParameters& q = y.setup.axes[i].parameters;
    EXPECT_EQ(x.setup.axes[i].shares_shaft_with, y.setup.axes[i].shares_shaft_with);
    EXPECT_EQ(x.setup.axes[i].shares_amplifier_with, y.setup.axes[i].shares_amplifier_with);
    ASSERT_EQ(p.machine.index(), q.machine.index());
    for (const CurveParameter& row : axis_curves(p))
      expect_equal(row.get(p).points(), row.get(q).points());
    for (const Parameter& row : axis_parameters(p)) {
      EXPECT_EQ(std::bit_cast<std::uint64_t>(row.get(p)), std::bit_cast<std::uint64_t>(row.get(q)))
          << row.name;
    }
    expect_equal(x.axes[i].events, y.axes[i].events);
  }
}

}  // namespace drivebench::test
