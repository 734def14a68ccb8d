#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/config/config.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::transports_test {
namespace {

/// kBench with [modbus] in line 21 and `lines` from line 22 on.
std::string with_modbus(const std::string& lines) {
  return kBench + "[modbus]\n" + lines;
}

// Catches: a rule of [modbus] that is not checked, above all writes that any computer may send.
TEST(ConfigModbus, EachRuleIsKept) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"address = \"0\"\n", ":22: modbus.address is \"0\" but must be an IPv4 or IPv6 address"},
      {"address = \"0.0.0.0\"\nallow_writes = true\n",
       ":23: modbus.allow_writes is true at 0.0.0.0, which other computers can reach, and Modbus knows no "
       "password"},
      {"address = \"::\"\nallow_writes = true\nunprotected = false\n",
       ":23: modbus.allow_writes is true at ::,"},
      {"port = 65536\n", ":22: modbus.port is 65536 but must lie between 0 and 65535"},
      {"allow_writes = 1\n", ":22: modbus.allow_writes is 1 but must be true or false"},
      {"unprotected = 1\n", ":22: modbus.unprotected is 1 but must be true or false"},
      {"max_connections = 0\n", ":22: modbus.max_connections is 0 but must lie between 1 and 1024"},
      {"max_connections = 1025\n", ":22: modbus.max_connections is 1025 but must"},
      {"requests_per_s = -1\n", ":22: modbus.requests_per_s is -1 but must lie between 0 and 1000000"},
      {"requests_per_s = 1000001\n", ":22: modbus.requests_per_s is 1000001 but must"},
      {"frame_timeout_ms = 9\n", ":22: modbus.frame_timeout_ms is 9 but must lie between 10 and 60000"},
      {"frame_timeout_ms = 60001\n", ":22: modbus.frame_timeout_ms is 60001 but must"},
      {"idle_timeout_ms = 99\n", ":22: modbus.idle_timeout_ms is 99 but must lie between 100 and 86400000"},
      {"idle_timeout_ms = 86400001\n", ":22: modbus.idle_timeout_ms is 86400001 but must"},
      {"baud = 9600\n", ":22: modbus.baud is not a known key; known here: address, port, allow_writes, "},
  };
  for (const auto& [lines, said] : cases) {
    const std::string found = problems_of(with_modbus(lines));
    EXPECT_EQ(found.find("b.toml" + said), 0u) << lines << "  gave: " << found;
  }
  EXPECT_EQ(problems_of(with_modbus("address = \"0.0.0.0\"\n")), "none");
  EXPECT_EQ(problems_of(with_modbus("allow_writes = true\n")), "none");
  EXPECT_EQ(problems_of(with_modbus("address = \"::\"\nallow_writes = true\nunprotected = true\n")), "none");
}

// Catches: an empty section that is ignored, and a default that is not the documented one.
TEST(ConfigModbus, TheSectionAloneTurnsItOn) {
  EXPECT_FALSE(parse(kBench).modbus.enabled);
  ModbusConfig modbus;
  modbus.enabled = true;
  expect_equal(parse(with_modbus("")).modbus, modbus);
}

// Catches: a server that starts without a part of TLS, or with a key that every user can read.
TEST(ConfigTls, EachRuleIsKept) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"certificate = \"c.pem\"\n", "tls.key is missing"},
      {"key = \"/nonexistent-folder/key.pem\"\n", "tls.certificate is missing"},
      {"certificate = \"c.pem\"\nkey = \"/nonexistent-folder/key.pem\"\n",
       "tls.key names /nonexistent-folder/key.pem, which cannot be used: No such file or directory"},
      {"certificate = \"c.pem\"\nkey = \"/etc/passwd\"\n",
       "tls.key names /etc/passwd, which others may read: chmod 600 it"},
      {"client_crl = \"crl.pem\"\n", "tls.client_crl cannot stand without client_ca"},
  };
  for (const auto& [lines, said] : cases) {
    const std::string found = problems_of(kBench + "[tls]\n" + lines);
    EXPECT_NE(found.find(said), std::string::npos) << lines << "  gave: " << found;
  }
}

/// A configuration in which no value of a bus or of Modbus is the default.
BenchConfig busy_bench() {
  BenchConfig config = parse(kBench);
  CanConfig bus{.channel = "239.1.2.3",
                .port = 1,
                .required = false,
                .profile = {},
                .bit_rate = 10'000,
                .data_bit_rate = 8'000'000,
                .sample_every_ticks = 7,
                .state_every_ticks = 1'000'000,
                .edges = true,
                .heartbeat_ms = 0,
                .controller_timeout_ms = 60'000,
                .idle_timeout_ms = 86'400'000};
  bus.profile.choose_ids(can::IdSet::kCanopen, true);
  bus.profile.current_unit_a = 1.0 / 3.0;
  bus.profile.voltage_unit_v = 1e-12;
  bus.profile.bus_voltage_unit_v = 1e6;
  bus.profile.speed_unit_rad_s = 0.1 + 0.2;
  bus.profile.edge_time_unit_s = 4e-9;
  for (std::uint32_t i = 0; i < bus.profile.base_ids.size(); ++i)
    bus.profile.base_ids[i] = 0x1FFFFF80 - 0x80 * i;
  config.can.push_back(bus);
  bus.profile.fd = false;
  bus.edges = false;
  const auto add = [&](can::Backend backend, const std::string& channel, std::uint16_t port) {
    bus.backend = backend;
    bus.channel = channel;
    bus.port = port;
    config.can.push_back(bus);
  };
  const std::uint16_t no_port = CanConfig{}.port;
  add(can::Backend::kSocketCan, "vcan0", no_port);
  add(can::Backend::kSlcan, "pty:/run/\"a\\b\"", no_port);
  add(can::Backend::kSocketcand, "::1", 0);
  config.modbus = {.enabled = true,
                   .address = "0.0.0.0",
                   .port = 0,
                   .allow_writes = true,
                   .unprotected = true,
                   .max_connections = 1024,
                   .requests_per_s = 0,
                   .frame_timeout_ms = 60'000,
                   .idle_timeout_ms = 86'400'000};
  return config;
}

// Catches: a value that the canonical text loses, rounds or swaps.
TEST(ConfigTransports, TheCanonicalTextReadsBackEqual) {
  const BenchConfig config = busy_bench();
  expect_equal(parse(to_toml(config)), config);
  EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
  EXPECT_EQ(to_toml(parse(kBench)).find("can]"), std::string::npos);
  EXPECT_EQ(to_toml(parse(kBench)).find("modbus"), std::string::npos);
}

// Catches: a recording made over CAN or Modbus that replays on no other bench, or that cannot be read without
// a folder.
TEST(ConfigTransports, ABusChangesNeitherThePhysicsNorTheReplay) {
  const BenchConfig config = busy_bench();
  EXPECT_EQ(physics_toml(config), physics_toml(parse(kBench)));
  EXPECT_EQ(configuration_hash(config), configuration_hash(parse(kBench)));
  expect_equal(parse_config(to_toml(config), "bench.toml", {}), config);
}

// Catches: a bench for CAN or Modbus that is no longer the bench of the book, or whose name does not fit its
// bus.
TEST(ConfigTransports, ShippedBenchesAreTheServoBenchWithABus) {
  const std::uint64_t servo = configuration_hash(load_config(kConfigs / "benches/servo.toml"));
  const BenchConfig udp = load_config(kConfigs / "benches/servo-can.toml");
  EXPECT_EQ(configuration_hash(udp), servo);
  ASSERT_EQ(udp.can.size(), 1u);
  expect_equal(udp.can[0], CanConfig{});
  const BenchConfig modbus = load_config(kConfigs / "benches/servo-modbus.toml");
  EXPECT_EQ(configuration_hash(modbus), servo);
  EXPECT_TRUE(modbus.modbus.enabled);
  EXPECT_TRUE(modbus.modbus.allow_writes);
  EXPECT_TRUE(is_loopback(modbus.modbus.address));
  const BenchConfig realtime = load_config(kConfigs / "benches/servo-can-realtime.toml");
  EXPECT_EQ(realtime.mode, RunMode::kRealtime);
  ASSERT_EQ(realtime.can.size(), 1u);
  EXPECT_FALSE(realtime.can[0].required);
  EXPECT_EQ(realtime.setup.period_ns * realtime.can[0].sample_every_ticks, 1'000'000);
}

}  // namespace
}  // namespace drivebench::test::transports_test
