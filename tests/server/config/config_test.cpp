#include "server/config/config.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::config_test {
namespace {

// Catches: a shipped bench or motor that the reader no longer takes.
TEST(Config, EveryShippedBenchLoadsAndEveryMotorFitsABench) {
  int benches = 0;
  for (const auto& entry : fs::directory_iterator(kConfigs / "benches")) {
    SCOPED_TRACE(entry.path());
    EXPECT_NO_THROW(load_config(entry.path()));
    ++benches;
  }
  EXPECT_GE(benches, 2);
  const std::string machine = kBench.substr(kBench.find("[axis.machine]"),
                                            kBench.find("[axis.amplifier]") - kBench.find("[axis.machine]"));
  for (const auto& entry : fs::directory_iterator(kConfigs / "motors")) {
    SCOPED_TRACE(entry.path());
    EXPECT_NO_THROW(parse(with(machine, "motor = \"" + fs::canonical(entry.path()).string() + "\"\n")));
  }
}

// Catches: a number of the motor that was copied wrongly, and lost or mixed-up keys.
TEST(Config, ServoBenchIsTheBenchOfTheBook) {
  const BenchConfig config = load_config(kConfigs / "benches/servo.toml");
  EXPECT_EQ(config.mode, RunMode::kLockstep);
  EXPECT_EQ(config.setup.period_ns, 125'000);
  EXPECT_EQ(config.setup.substeps, 5);
  EXPECT_EQ(config.setup.command_delay_ticks, 0);
  EXPECT_EQ(config.setup.watchdog_ticks, 20);
  EXPECT_EQ(config.setup.lease_ticks, 16'000);
  ASSERT_EQ(config.setup.axes.size(), 1u);
  const AxisParameters& p = config.setup.axes[0].parameters;
  EXPECT_EQ(config.axes[0].name, "servo");
  EXPECT_EQ(config.axes[0].motor, "servo IM, 1/12 hp");
  const InductionMachineConstants c =
      constants_of(std::get<InductionMachineParameters>(p.machine));  // reference values of the same motor
  EXPECT_NEAR(c.sigma, 0.30158, 1e-5);
  EXPECT_NEAR(c.eta_per_s, 278.571, 1e-3);
  EXPECT_NEAR(c.beta_per_h, 197.94, 1e-2);
  EXPECT_NEAR(c.gamma_per_s, 1047.8, 0.1);
  EXPECT_NEAR(c.torque_constant, 2.5071, 1e-4);
  EXPECT_NEAR(p.mechanics.viscous_friction_nms / p.mechanics.inertia_kgm2, 1.2727, 1e-4);
  EXPECT_EQ(p.drive.amplifier.voltage_limit_v, 80.0);
  EXPECT_EQ(p.drive.amplifier.over_current_a, 6.0);
  EXPECT_FALSE(p.drive.amplifier.over_current_trip);
  EXPECT_EQ(p.encoder.counts_per_revolution, 2000);
  EXPECT_EQ(p.sensors.current.bits, 0);
}

// Catches: a real-time bench that differs from the lockstep bench in more than time.
TEST(Config, RealtimeBenchDiffersFromTheLockstepBenchInTimeOnly) {
  const BenchConfig lockstep = load_config(kConfigs / "benches/servo.toml");
  BenchConfig realtime = load_config(kConfigs / "benches/servo-realtime.toml");
  EXPECT_EQ(realtime.mode, RunMode::kRealtime);
  EXPECT_EQ(realtime.setup.command_delay_ticks, 1);
  EXPECT_NE(configuration_hash(realtime), configuration_hash(lockstep));
  EXPECT_EQ(realtime.setup.arming_commands, 10);
  realtime.setup.command_delay_ticks = 0;
  realtime.setup.arming_commands = 1;
  EXPECT_EQ(physics_toml(realtime), physics_toml(lockstep));
}

// Catches: a key that the writer forgets, and a number that loses a bit on the way.
TEST(Config, CanonicalTextReadsBackBitForBit) {
  BenchConfig config = load_config(kConfigs / "benches/servo-realtime.toml");
  expect_equal(parse(to_toml(config)), config);

  config.name = "other-1";
  config.mode = RunMode::kFree;
  config.setup.substeps = 32;
  config.setup.period_ns = 333'333;
  config.setup.seed = 9'007'199'254'740'993;
  config.setup.watchdog_ticks = 7;
  config.setup.lease_ticks = 8'001;
  config.realtime = {.pacer = PacerKind::kSleep, .max_lateness_ns = 1'234'567, .cpu = 3, .priority = 0};
  config.tcp = {.address = "::1",
                .port = 0,
                .unix_path = "/run/a \"b\" \\c",
                .grants = {},
                .max_sessions = 2,
                .max_sessions_of_address = 1};
  config.axes[0].motor = "mötor \"x\"";
  config.axes[0].events = {
      {.tick = 3, .action = LoadChange{.load_nm = -0.1, .ramp_ticks = 0}},
      {.tick = 4'000'000'000'000, .action = LoadChange{.load_nm = 1.0 / 3.0, .ramp_ticks = 99}}};
  config.axes.push_back(config.axes[0]);
  config.axes[1].name = "second";
  config.axes[1].motor = "";
  config.axes[1].can_node = 127;
  config.setup.axes.push_back(config.setup.axes[0]);
  config.setup.arming_commands = 7;
  config.setup.axes[1].on_link_loss = SafeAction::kQuickStop;
  config.setup.axes[1].quick_stop_ticks = 123;
  config.setup.axes[1].rules = {.on_excess = OnExcess::kRefuse, .slew_per_s = 1.0 / 3.0};
  AxisParameters& p = config.setup.axes[1].parameters;
  std::get<InductionMachineParameters>(p.machine).rotor_resistance_ohm = 3.9 * 1.5;
  p.drive.amplifier.offset_a_v = -0.0;
  p.drive.amplifier.over_current_trip = true;
  p.encoder.half_count_offset = true;
  p.sensors.current = {.bits = 12, .full_scale_a = 0.1 + 0.2, .noise_rms_a = 5e-324};
  expect_equal(parse(to_toml(config)), config);
  EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
}

// Catches: a secret in a recording, and an address that opens without its secret.
TEST(Config, CanonicalTextHoldsNeitherTokenNorAnAddressThatNeedsIt) {
  BenchConfig config = parse(kBench);
  config.tcp.asks_for_token = true;
  config.tcp.grants = {{.name = "anna-sesame", .role = Role::kAdmin, .hash = hash_of_token("open")}};
  config.tcp.address = "192.0.2.1";
  EXPECT_EQ(to_toml(config).find("sesame"), std::string::npos);
  EXPECT_EQ(parse(to_toml(config)).tcp.address, "127.0.0.1");
}

/// kBench with an elastic shaft and more, so that values may change one by one.
BenchConfig bench_with_room() {
  std::string text =
      with("1.1e-4\n", "1.1e-4\nstatic_friction_nm = 1\nload_inertia_kgm2 = 1\nshaft_stiffness_nm = 10\n");
  BenchConfig config = parse(text +
                             "[axis.bus]\ncapacitance_f = 1e-3\nchopper_on_v = 90\nchopper_off_v = 85\n"
                             "[axis.tachometer]\ngain_vs_per_rad = 0.1\nripple_per_turn = 12\n");
  AxisParameters& p = config.setup.axes[0].parameters;
  p.sensors.current.bits = 12;
  p.encoder.timer_bits = 16;
  return config;
}

/// The same with three phases in a star, which comparators need.
BenchConfig bench_with_star() {
  BenchConfig config = bench_with_room();
  AxisParameters& p = config.setup.axes[0].parameters;
  std::get<InductionMachineParameters>(p.machine).star = true;
  p.sensors.comparator.hysteresis_v = 0.1;
  return config;
}

/// That star on the parts of a board.
BenchConfig bench_with_board() {
  BenchConfig config = bench_with_star();
  AxisParameters& p = config.setup.axes[0].parameters;
  p.drive.kind = DriveKind::kSwitched;
  p.drive.amplifier.filter_hz = 0.0;
  p.sensors.current.filter_hz = 0.0;
  p.sensors.current.delay_ticks = 0.0;
  p.sensors.shunts = {.sample_s = 10e-6, .conversion_s = 1e-6};
  p.sensors.counts = true;
  p.sensors.temperature.enabled = true;
  p.sensors.temperature.bits = 12;
  p.sensors.ntc = {.ohm = 10e3, .beta_k = 3435.0, .pull_ohm = 10e3};
  p.sensors.absolute = {.bits = 12, .latency_s = 10e-6};
  p.sensors.hall = {.enabled = true, .capture_bits = 16, .capture_hz = 1e6};
  p.drive.inverter.bootstrap_s = 1e-3;
  return config;
}

/// The same with conversions by the angle of the PWM.
BenchConfig bench_with_angle() {
  BenchConfig config = bench_with_board();
  config.setup.axes[0].parameters.sensors.shunts = {.sample_angle_rad = 3.0};
  return config;
}

/// The same behind a transformer, whose values mean nothing alone.
BenchConfig bench_with_transformer() {
  BenchConfig config = bench_with_room();
  DriveParameters& drive = config.setup.axes[0].parameters.drive;
  drive.kind = DriveKind::kSource;
  drive.transformer = {.turns_ratio = 2.0, .magnetising_inductance_h = 1.0};
  return config;
}

/// The bench with another value in this row, if one of several breaks no rule.
std::optional<BenchConfig> with_another_value(const BenchConfig& base, const Parameter& row) {
  const double old = row.get(base.setup.axes[0].parameters);
  std::vector<double> candidates{old * 1.0009765625, old + 1.0009765625, 0.5,
                                 0.0009765625,       row.maximum,        row.minimum};
  if (row.integer) candidates = {old + 1.0, old + 2.0, old + 4.0, old - 1.0, old - 2.0};
  for (const double value : candidates) {
    BenchConfig config = base;
    row.set(config.setup.axes[0].parameters, value);
    if (row.get(config.setup.axes[0].parameters) == old || !problems(config.setup.axes[0].parameters).empty())
      continue;
    if (problems_of(to_toml(config)) == "none") return config;
  }
  return std::nullopt;
}

// Catches: a row of the parameter table that no key reaches, and one that reaches another row.
TEST(Config, EveryRowOfTheParameterTableHasAKeyOfItsOwn) {
  const BenchConfig room = bench_with_room();
  const BenchConfig transformer = bench_with_transformer();
  const BenchConfig star = bench_with_star();
  const BenchConfig board = bench_with_board();
  const BenchConfig angle = bench_with_angle();
  const auto is_of_board = [](const Parameter& row) {
    return row.later && (row.name.starts_with("inverter.") || row.name.starts_with("current_sensor.") ||
                         row.name.starts_with("temperature_sensor.") ||
                         row.name.starts_with("absolute_encoder.") || row.name.starts_with("hall."));
  };
  std::string alone;
  for (const Parameter& row : axis_parameters(room.setup.axes[0].parameters)) {
    const BenchConfig& base = row.name.starts_with("transformer.")            ? transformer
                              : row.name.starts_with("comparator.")           ? star
                              : row.name == "current_sensor.sample_angle_rad" ? angle
                              : is_of_board(row)                              ? board
                                                                              : room;
    if (const auto config = with_another_value(base, row)) {
      expect_equal(parse(to_toml(*config)), *config);
      EXPECT_NE(to_toml(*config), to_toml(base)) << row.name;
    } else {
      alone += std::string(row.name) + " ";
    }
  }
  EXPECT_EQ(alone, "") << "every other value breaks a rule";
}

// Catches: a hash that depends on a port, which would forbid the replay, and a hash that misses a value of
// the physics.
TEST(Config, HashFollowsThePhysicsAndNothingElse) {
  const BenchConfig base = parse(kBench);
  const auto changed = [&](auto change) {
    BenchConfig config = base;
    change(config);
    return configuration_hash(config) != configuration_hash(base);
  };
  EXPECT_FALSE(changed([](BenchConfig& c) { c.name = "z"; }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.mode = RunMode::kFree; }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.tcp.port = 1; }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.realtime.pacer = PacerKind::kSleep; }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.axes[0].motor = "z"; }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.axes[0].can_node = 9; }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.can.resize(2); }));
  EXPECT_FALSE(changed([](BenchConfig& c) { c.modbus.enabled = true; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { ++c.setup.period_ns; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { ++c.setup.seed; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { c.setup.command_delay_ticks = 1; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { ++c.setup.lease_ticks; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { ++c.setup.arming_commands; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { c.setup.axes[0].on_link_loss = SafeAction::kZeroVoltage; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { ++c.setup.axes[0].quick_stop_ticks; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { c.setup.axes[0].rules.on_excess = OnExcess::kRefuse; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { c.setup.axes[0].rules.slew_per_s = 1e6; }));
  EXPECT_TRUE(changed([](BenchConfig& c) { c.axes[0].events.push_back({1, LoadChange{1.0, 0}}); }));
  EXPECT_TRUE(changed([](BenchConfig& c) {
    std::get<InductionMachineParameters>(c.setup.axes[0].parameters.machine).rotor_resistance_ohm *=
        1 + 1e-15;
  }));
}

// Catches: a default that depends on the wrong mode.
TEST(Config, CommandsWaitATickByDefaultInRealTimeOnly) {
  EXPECT_EQ(parse(kBench).setup.command_delay_ticks, 0);
  EXPECT_EQ(parse(with("lockstep", "free")).setup.command_delay_ticks, 0);
  EXPECT_EQ(parse(with("lockstep", "realtime")).setup.command_delay_ticks, 1);
  EXPECT_EQ(parse(with("125", "125\ncommand_delay_ticks = 1")).setup.command_delay_ticks, 1);
}

// Catches: a lockstep run that loses its first commands to arming, and a mode from the command line that
// keeps the defaults of another.
TEST(Config, TheFirstCommandArmsUnlessTimeIsReal) {
  EXPECT_EQ(parse(kBench).setup.arming_commands, 1);
  BenchConfig config = parse(with("lockstep", "realtime"));
  EXPECT_EQ(config.setup.arming_commands, 10);
  change_mode(config, RunMode::kLockstep);
  EXPECT_EQ(config.setup.arming_commands, 1);
  change_mode(config, RunMode::kRealtime);
  EXPECT_EQ(config.setup.arming_commands, 10);
  EXPECT_EQ(config.setup.command_delay_ticks, 1);
  config = parse(with("125", "125\narming_commands = 3"));
  change_mode(config, RunMode::kRealtime);
  EXPECT_EQ(config.setup.arming_commands, 3) << "the file's value stays";
}

// Catches: a period that is cut to whole microseconds, and a lease shorter than the watchdog by default.
TEST(Config, TimesAreWholeNanosecondsAndTicks) {
  EXPECT_EQ(parse(with("125", "62.5")).setup.period_ns, 62'500);
  EXPECT_EQ(parse(with("125", "33.333")).setup.period_ns, 33'333);
  EXPECT_EQ(parse(with("125", "33.333")).setup.lease_ticks, 60'001);
  EXPECT_EQ(parse(with("125", "125\nwatchdog_ticks = 100000")).setup.lease_ticks, 100'000);
  const BenchConfig config = parse(kBench +
                                   "[[axis.load]]\nat_s = 0.03\nload_nm = 0.1\nramp_s = 0.001\n"
                                   "[[axis.load]]\nat_tick = 7\nload_nm = -1\n");
  const std::vector<AxisEvent>& events = config.axes[0].events;
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].tick, 7);
  EXPECT_EQ(std::get<LoadChange>(events[0].action).load_nm, -1.0);
  EXPECT_EQ(std::get<LoadChange>(events[0].action).ramp_ticks, 0);
  EXPECT_EQ(events[1].tick, 240);
  EXPECT_EQ(std::get<LoadChange>(events[1].action).ramp_ticks, 8);
}

}  // namespace
}  // namespace drivebench::test::config_test
