#include "server/config/config.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::rules_test {
namespace {

// Catches: a reader that stops at the first problem, or names the wrong line.
TEST(ConfigRules, CFG_01_AllProblemsAreReportedAtOnceWithTheirLines) {
  std::string text = kBench;
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"period_us = 125", "peroid_us = 125"},
           {"pole_pairs = 3", "pole_pairs = 3.0"},
           {"rotor_resistance_ohm = 3.9", "rotor_resistance_ohm = -3.9"},
           {"over_current_a = 6.0\n", ""},
           {"= 2000", "= 2001"}}) {
    text.replace(text.find(from), from.size(), to);
  }
  EXPECT_EQ(problems_of(text),
            "b.toml:1: bench.period_us is missing\n"
            "b.toml:4: bench.peroid_us is not a known key; did you mean \"period_us\"?\n"
            "b.toml:8: axis.machine.pole_pairs is 3 but must be a whole number\n"
            "b.toml:10: axis.machine.rotor_resistance_ohm is -3.9 but must lie between 1e-06 and 1e+06 ohm\n"
            "b.toml:16: axis.amplifier.over_current_a is missing\n"
            "b.toml:19: axis.encoder.counts_per_revolution is 2001 but must be a multiple of 4");
}

// Catches: a rule that is not checked: each row is an edit of a good bench and the expected problem.
TEST(ConfigRules, CFG_01_CFG_02_CFG_03_CFG_04_SEC_02_EachRuleIsKept) {
  struct Case {
    std::string from, to, said;
  };
  const std::vector<Case> cases = {
      {"name = \"b\"", "name = \"b/..\"", ":2: bench.name is \"b/..\" but may hold only letters"},
      {"name = \"b\"", "name = 3", ":2: bench.name is 3 but must be text in quotes"},
      {"name = \"b\"", "name = \"\\u0000\"", ":2: bench.name is \"?\" but must be text"},
      {"\"lockstep\"", "\"Lockstep\"", ":3: bench.mode is \"Lockstep\" but must be one of \"realtime\", "},
      {"mode = \"lockstep\"\n", "", ":1: bench.mode is missing"},
      {"125", "0.9", ":4: bench.period_us is 0.9 but must lie between 1 and 1e+06"},
      {"125", "62.5001", ":4: bench.period_us is 62.5001 but must be whole nanoseconds; the nearest is 62.5"},
      {"125", "nan", ":4: bench.period_us is nan but must be a finite number"},
      {"125", "inf", ":4: bench.period_us is inf but must be a finite number"},
      {"125", "1e400", ":4: Error while parsing floating-point"},
      {"125", "1,5", ":4: Error"},
      {"125", "0x7d", ":4: bench.period_us is a number that is not decimal but must be a finite number"},
      {"125", "", ":4: Error"},
      {"125", "2024-01-01", ":4: bench.period_us is a date or time but must be a finite number"},
      {"125", "125\nsubsteps = 65", ":5: bench.substeps is 65 but must lie between 1 and 64"},
      {"125", "125\nsubsteps = 5.0", ":5: bench.substeps is 5 but must be a whole number"},
      {"125", "125\nseed = -1", ":5: bench.seed is -1"},
      {"125", "125\nwatchdog_ticks = 0", ":5: bench.watchdog_ticks is 0"},
      {"125", "125\nlease_s = 0.002", ":5: bench.lease_s comes to 16 ticks but must not be shorter than"},
      {"125", "125\nlease_ticks = 8000000000001",
       ":5: bench.lease_ticks comes to 8000000000001 ticks but must not be longer than 1e+09 s, "
       "8000000000000 "
       "ticks"},
      {"period_us = 125", "period_us = 1e6\nlease_ticks = 1000000000000000",
       ":5: bench.lease_ticks comes to 1000000000000000 ticks but must not be longer than 1e+09 s, "
       "1000000000 "
       "ticks"},
      {"125", "125\nlease_s = 2\nlease_ticks = 9", ":6: bench.lease_ticks cannot stand beside lease_s"},
      {"125", "125\ncommand_delay_ticks = 2", ":5: bench.command_delay_ticks is 2"},
      {"\"lockstep\"", "\"realtime\"\ncommand_delay_ticks = 0",
       ":4: bench.command_delay_ticks is 0 but must be 1"},
      {"125", "125\nperiod_us = 125", ":5: Error while parsing key-value pair: cannot redefine existing"},
      {"125\n", "125\n[realtime]\npacer = \"spin\"\n", ":6: realtime.pacer is \"spin\" but must be one of"},
      {"125\n", "125\n[realtime]\npriority = 100\n", ":6: realtime.priority is 100"},
      {"125\n", "125\n[tcp]\nport = 65536\n", ":6: tcp.port is 65536"},
      {"125\n", "125\n[tcp]\naddress = \"0.0.0.0\"\n", ":6: tcp.address is 0.0.0.0, which other computers"},
      {"125\n", "125\n[tcp]\naddress = \"::\"\n", ":6: tcp.address is ::, which other computers"},
      {"125\n", "125\n[tcp]\naddress = \"0x7f000001\"\n",
       ":6: tcp.address is \"0x7f000001\" but must be an IPv4"},
      {"125\n", "125\n[tcp]\naddress = \"0\"\n", ":6: tcp.address is \"0\" but must be an IPv4"},
      {"125\n", "125\n[tcp]\naddress = \"127.1\"\n", ":6: tcp.address is \"127.1\" but must be an IPv4"},
      {"125\n", "125\n[tcp]\nadress = \"::1\"\n",
       ":6: tcp.adress is not a known key; did you mean \"address\"?"},
      {"125\n", "125\n[udp]\nport = 1\n", ":5: udp is not a known key; did you mean \"tcp\"?"},
      {"[bench]", "bench = 1\n[bunch]", ":1: bench is 1 but must be a table: [bench]"},
      {"[[axis]]", "[axis]", ":5: axis is a table but must be a list of tables, each headed [[axis]]"},
      {"name = \"x\"\n", "", ":5: axis.name is missing"},
      {"name = \"x\"", "name = \"x\"\n[[axis]]\nname = \"x\"",
       ":8: axis.name is \"x\", the name of another axis"},
      {"name = \"x\"", "name = \"x\"\ncan_node = 0", ":7: axis.can_node is 0 but must lie between 1 and 127"},
      {"name = \"x\"", "name = \"x\"\ncan_node = 128", ":7: axis.can_node is 128 but must lie between 1"},
      {"name = \"x\"", "name = \"w\"\ncan_node = 2\n[[axis]]\nname = \"x\"",
       ":8: axis.can_node is 2, the node of another axis"},
      {"name = \"x\"", "name = \"x\"\non_link_loss = \"coast\"",
       ":7: axis.on_link_loss is \"coast\" but must be"},
      {"name = \"x\"", "name = \"x\"\nquick_stop_ticks = 0",
       ":7: axis.quick_stop_ticks comes to 0 ticks but must come to 1 to 1000000"},
      {"name = \"x\"", "name = \"x\"\nquick_stop_s = 126.0", ":7: axis.quick_stop_s comes to 1008000 ticks"},
      {"name = \"x\"", "name = \"x\"\non_excess = \"ignore\"",
       ":7: axis.on_excess is \"ignore\" but must be"},
      {"name = \"x\"", "name = \"x\"\nslew_per_s = -1.0", ":7: axis.slew_per_s is -1 but must lie between 0"},
      {"period_us = 125", "period_us = 125\narming_commands = 0",
       ":5: bench.arming_commands is 0 but must lie between 1 and 1000"},
      {"name = \"x\"", "name = \"x\"\nmotor = \"m.toml\"",
       ":7: axis.motor names /nonexistent/m.toml, which cannot"},
      {"name = \"x\"", "name = \"x\"\nmotor = \"/dev/zero\"",
       ":7: axis.motor names /dev/zero, which is not a reg"},
      {"name = \"x\"", "name = \"x\"\nmotor = \"/\"", ":7: axis.motor names /, which is a directory"},
      {"pole_pairs = 3", "pole_pairs = 0",
       ":8: axis.machine.pole_pairs is 0 but must lie between 1 and 1000"},
      {"pole_pairs = 3", "pole_pairs = 99999999999", ":8: axis.machine.pole_pairs is 99999999999 but"},
      {"stator_inductance_h", "stator_inductance_mh",
       ":11: axis.machine.stator_inductance_mh is not a known key; "
       "did you mean \"stator_inductance_h\"?"},
      {"0.0117", "0.014", ":13: axis.machine.mutual_inductance_h makes the leakage factor"},
      {"1.1e-4\n", "1.1e-4\ncoulomb_friction_nm = 1\n",
       ":14: axis.mechanics.static_friction_nm is 0 but must not"},
      {"6.0\n", "6.0\nover_current_trip = 1\n",
       ":19: axis.amplifier.over_current_trip is 1 but must be true or"},
      {"2000\n", "2000\n[[axis.load]]\nload_nm = 1\n", ":21: axis.load.at_s is missing"},
      {"2000\n", "2000\n[[axis.load]]\nat_s = 1\n", ":21: axis.load.load_nm is missing"},
      {"2000\n", "2000\n[[axis.load]]\nat_s = -1\nload_nm = 1\n", ":22: axis.load.at_s is -1"},
      {"2000\n", "2000\n[axis.load]\nat_s = 1\nload_nm = 1\n",
       ":21: axis.load is a table but must be a list"},
      {"2000\n", "2000\n[axis.gearbox]\n", ":21: axis.gearbox is not a known key; known here: name, motor,"},
  };
  for (const Case& c : cases) {
    const std::string found = problems_of(with(c.from, c.to));
    EXPECT_NE(found.find("b.toml" + c.said), std::string::npos) << c.to << "\n  gave: " << found;
  }
}

// Catches: a longest lease that is refused although its nanoseconds can be counted.
TEST(ConfigRules, TheLongestLeaseIsTaken) {
  EXPECT_EQ(problems_of(with("125", "125\nlease_ticks = 8000000000000")), "none");
  const BenchConfig config = parse(with("125", "33.333\nlease_s = 1e9"));
  EXPECT_EQ(config.setup.lease_ticks, 30'000'300'003'000) << "to the nearest tick";
  EXPECT_EQ(problems_of(to_toml(config)), "none");
}

// Catches: a step that RK4 cannot take, or advice that does not help.
TEST(ConfigRules, CFG_05_StepTooLongForTheMachineIsRefusedWithTheSubstepsItNeeds) {
  const std::string found = problems_of(with("125", "2000\nsubsteps = 4"));
  EXPECT_NE(found.find(":5: bench.substeps comes to steps of 500 us, too long"), std::string::npos) << found;
  EXPECT_NE(found.find("axis \"x\", 809.3"), std::string::npos) << found;  // its fastest pole
  EXPECT_NE(found.find("at least 5 substeps"), std::string::npos) << found;
  EXPECT_EQ(problems_of(with("125", "2000\nsubsteps = 5")), "none");

  const std::string slow = problems_of(with("125", "40000"));
  EXPECT_NE(slow.find(":4: bench.period_us"), std::string::npos) << slow;
  const std::size_t at = slow.find("at most ") + 8;
  EXPECT_EQ(problems_of(with("125", slow.substr(at) + "\nsubsteps = 64")), "none") << slow;
}

}  // namespace
}  // namespace drivebench::test::rules_test
