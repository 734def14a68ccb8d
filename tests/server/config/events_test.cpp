#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "protocols/text.hpp"
#include "server/config/config.hpp"
#include "tests/server/config/config_test_bench.hpp"
#include "tests/server/parameter_row.hpp"

namespace drivebench::test::events_test {
namespace {

const std::string kSet = "[[axis.set]]\nparameter = \"machine.rotor_resistance_ohm\"\n";

std::vector<AxisEvent> events_of(const std::string& more) {
  return parse(kBench + more).axes[0].events;
}

constexpr Multisine kSpeedLoop{.quantity = Multisine::Quantity::kLoad,
                               .periods = 5,
                               .amplitude = 0.01,
                               .lines = {.period_ticks = 4000, .lowest = 1, .highest = 200, .ratio = 1.5}};

const AxisParameters& parameters() {
  static const BenchConfig config = parse(kBench);
  return config.setup.axes[0].parameters;
}

// Catches: a kind of event that is not read, a time in seconds that is cut, an end that is not an event, an
// order in which a fault ends after it has begun anew.
TEST(ConfigEvents, EveryKindIsReadInOrder) {
  const std::vector<AxisEvent> events = events_of(
      "[[axis.bump]]\nat_tick = 8\nimpulse_nms = -0.5\n"
      "[[axis.fault]]\nname = \"bus_sag\"\nvalue = 0.25\nat_tick = 8\nuntil_s = 0.01\n"
      "[[axis.fault]]\nname = \"bus_sag\"\nvalue = 0.5\nat_tick = 0\nuntil_tick = 8\n" +
      kSet + "value = 5.85\nat_tick = 8\nramp_s = 0.5\n" +
      "[[axis.set]]\nparameter = \"amplifier.over_current_trip\"\nvalue = false\nat_s = 0.0010001\n"
      "[[axis.load]]\nat_tick = 8\nload_nm = 1\n"
      "[[axis.multisine]]\nat_tick = 8\nload_nm = 0.01\nperiod_s = 0.5\nperiods = 5\nfrom_hz = 2.9\n"
      "to_hz = 400.9\nratio = 1.5\n");
  const std::vector<AxisEvent> expected = {
      {0, fault_of("bus_sag", 0.5)},
      {8, LoadChange{1.0, 0}},
      {8, write_of(parameters(), "machine.rotor_resistance_ohm", 5.85, 4000)},
      {8, write_of(parameters(), "amplifier.over_current_trip", 0.0)},
      {8, fault_of("bus_sag", 0.0)},
      {8, fault_of("bus_sag", 0.25)},
      {8, ShaftBump{-0.5}},
      {8, kSpeedLoop},
      {80, fault_of("bus_sag", 0.0)},
  };
  expect_equal(events, expected);
}

// Catches: an event that the canonical text loses, changes or puts elsewhere.
TEST(ConfigEvents, AreWrittenAndReadBackBitForBit) {
  BenchConfig config = parse(kBench);
  config.axes[0].events = in_order({{7, ShaftBump{1.0 / 3.0}},
                                    {7, fault_of("hall_offset", -0.1)},
                                    {7, fault_of("open_phase", 0.0)},
                                    {4'000'000'000, fault_of("open_phase", 3.0)},
                                    {7, write_of(parameters(), "amplifier.gain", 0.1 + 0.2, 12'345)},
                                    {7, write_of(parameters(), "amplifier.over_current_trip", 1.0)},
                                    {9, kSpeedLoop},
                                    {0, LoadChange{-0.0, 9}}});
  expect_equal(parse(to_toml(config)), config);
  EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
}

// Catches: a hash that is blind to an event.
TEST(ConfigEvents, TheHashDependsOnEachOfThem) {
  const BenchConfig base = parse(kBench);
  std::vector<std::uint64_t> hashes{configuration_hash(base)};
  for (const Action& action : std::vector<Action>{
           kSpeedLoop, LoadChange{1.0, 0}, LoadChange{1.0, 1}, fault_of("bus_sag", 0.5),
           fault_of("bus_sag", 0.25), fault_of("open_phase", 1.0), ShaftBump{0.5},
           write_of(parameters(), "amplifier.gain", 1.5), write_of(parameters(), "amplifier.gain", 1.5, 2)}) {
    BenchConfig config = base;
    config.axes[0].events = {{5, action}};
    hashes.push_back(configuration_hash(config));
    config.axes[0].events = {{6, action}};
    hashes.push_back(configuration_hash(config));
  }
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_NE(hashes[i], hashes[j]) << i << " " << j;
  }
}

// Catches: a rule that is not checked, one by one.
TEST(ConfigEvents, EachRuleIsKept) {
  const std::string fault = "[[axis.fault]]\nname = \"open_phase\"\n";
  const std::string sum = "[[axis.multisine]]\nat_s = 1\nperiods = 5\nperiod_s = 0.5\n";
  const std::string lines = "from_hz = 2.0\nto_hz = 400.0\n";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {sum + lines, ":21: axis.multisine.load_nm or else current_offset_a must stand"},
      {sum + lines + "load_nm = 1\ncurrent_offset_a = 1\n", ":27: axis.multisine.load_nm or else"},
      {sum + lines + "load_nm = 1e5\n", ":27: axis.multisine.load_nm is 1e+05 but must lie"},
      {sum + "load_nm = 1\nfrom_hz = 2.0\n", ":21: axis.multisine.to_hz is missing"},
      {sum + "load_nm = 1\nfrom_hz = 0.5\nto_hz = 4.0\n",
       ":26: axis.multisine.from_hz is 0.5 but must come to one period in period_s, 2 Hz"},
      {sum + "load_nm = 1\nfrom_hz = 8.0\nto_hz = 4.0\n", ":27: axis.multisine.to_hz is 4 but must not lie"},
      {sum + "load_nm = 1\nfrom_hz = 8.0\nto_hz = 4000.0\n",
       ":27: axis.multisine.to_hz is 4000 but must lie below half the sample rate, 4000 Hz"},
      {sum + lines + "load_nm = 1\nratio = 1.01\n", ":28: axis.multisine.ratio makes more than 64 lines"},
      {"[[axis.multisine]]\nat_s = 1\nperiods = 5\nperiod_ticks = 7\nload_nm = 1\n" + lines,
       ":24: axis.multisine.period_ticks comes to 7 ticks but must come to 8"},
      {fault + "at_tick = 1\n", ":21: axis.fault.value is missing"},
      {fault + "value = 1\n", ":21: axis.fault.at_s is missing"},
      {fault + "value = 1\nat_s = 1\nat_tick = 1\n", ":25: axis.fault.at_tick cannot stand beside at_s"},
      {fault + "value = 4\nat_s = 1\n", ":23: axis.fault.value is 4 but must lie between 0 and 3 phase"},
      {fault + "value = 1.5\nat_s = 1\n", ":23: axis.fault.value is 1.5 but must be a whole number"},
      {fault + "value = nan\nat_s = 1\n", ":23: axis.fault.value is nan but must be a finite number"},
      {fault + "value = true\nat_s = 1\n", ":23: axis.fault.value is true but must be a finite number"},
      {fault + "value = 1\nat_tick = 5\nuntil_tick = 5\n",
       ":25: axis.fault.until_tick comes to tick 5 but must lie after tick 5"},
      {fault + "value = 1\nat_s = 1\nuntil_s = 0.5\n", ":25: axis.fault.until_s comes to tick 4000 but must"},
      {fault + "value = 1\nat_s = 1\nunti_s = 2\n",
       ":25: axis.fault.unti_s is not a known key; did you mean"},
      {"[[axis.fault]]\nname = \"open_phases\"\nvalue = 1\nat_s = 1\n",
       ":22: axis.fault.name is \"open_phases\" but must be one of \"open_phase\", "},
      {"[axis.fault]\nname = \"open_phase\"\n", ":21: axis.fault is a table but must be a list"},
      {kSet + "at_s = 1\n", ":21: axis.set.value is missing"},
      {kSet + "value = 5\n", ":21: axis.set.at_s is missing"},
      {kSet + "value = -5\nat_s = 1\n", ":23: axis.set.value is -5 but must lie between 1e-06 and 1e+06 ohm"},
      {kSet + "value = inf\nat_s = 1\n", ":23: axis.set.value is inf but must be a finite number"},
      {kSet + "value = \"5\"\nat_s = 1\n", ":23: axis.set.value is \"5\" but must be a finite number"},
      {kSet + "value = 5\nat_s = 1\nramp_s = -1\n", ":25: axis.set.ramp_s is -1 but must lie between"},
      {"[[axis.set]]\nvalue = 5\nat_s = 1\n", ":21: axis.set.parameter is missing"},
      {"[[axis.set]]\nparameter = \"machine.rr\"\nvalue = 5\nat_s = 1\n",
       ":22: axis.set.parameter is \"machine.rr\", but there is no such parameter"},
      {"[[axis.set]]\nparameter = \"machine.pole_pairs\"\nvalue = 5\nat_s = 1\n",
       ":22: axis.set.parameter is \"machine.pole_pairs\", which cannot be changed while"},
      {"[[axis.set]]\nparameter = \"amplifier.over_current_trip\"\nvalue = 1\nat_s = 1\n",
       ":23: axis.set.value is 1 but must be true or false"},
      {"[[axis.set]]\nparameter = \"amplifier.over_current_trip\"\nvalue = true\nat_s = 1\nramp_ticks = 2\n",
       ":25: axis.set.ramp_ticks must be 0: amplifier.over_current_trip has no values in between"},
      {"[[axis.bump]]\nat_s = 1\n", ":21: axis.bump.impulse_nms is missing"},
      {"[[axis.bump]]\nimpulse_nms = 1\n", ":21: axis.bump.at_s is missing"},
      {"[[axis.bump]]\nat_s = 1\nimpulse_nms = 1e7\n", ":23: axis.bump.impulse_nms is 1e+07 but must lie"},
  };
  for (const auto& [text, said] : cases) {
    const std::string found = problems_of(kBench + text);
    EXPECT_NE(found.find("b.toml" + said), std::string::npos) << text << "  gave: " << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << text << "  gave more than one: " << found;
  }
}

// Catches: a schedule whose values are checked one by one only: static friction may at no time be below
// Coulomb friction.
TEST(ConfigEvents, RulesBetweenValuesAreFollowedThroughTime) {
  const auto set = [](const char* name, double value, int tick, int ramp) {
    return "[[axis.set]]\nparameter = \"mechanics." + std::string(name) +
           "\"\nvalue = " + std::to_string(value) + "\nat_tick = " + std::to_string(tick) +
           "\nramp_ticks = " + std::to_string(ramp) + "\n";
  };
  const std::string up = set("static_friction_nm", 0.5, 10, 0) + set("coulomb_friction_nm", 0.5, 10, 0);
  EXPECT_EQ(problems_of(kBench + up), "none");
  EXPECT_EQ(
      problems_of(kBench + set("coulomb_friction_nm", 0.5, 11, 5) + set("static_friction_nm", 0.5, 10, 0)),
      "none");
  EXPECT_EQ(problems_of(kBench + up + set("static_friction_nm", 0.0, 30, 10) +
                        set("coulomb_friction_nm", 0.0, 30, 10)),
            "none");
  const std::string early = problems_of(kBench + set("coulomb_friction_nm", 0.5, 10, 0));
  EXPECT_NE(
      early.find("b.toml:23: axis.set.value would break a rule at tick 10: mechanics.static_friction_nm"),
      std::string::npos)
      << early;
  const std::string at_the_end = problems_of(kBench + up + set("static_friction_nm", 0.25, 20, 100));
  EXPECT_NE(at_the_end.find("b.toml:33: axis.set.value would break a rule at tick 120"), std::string::npos)
      << at_the_end;
  const std::string on_the_way = problems_of(kBench + up + set("static_friction_nm", 0.0, 20, 100) +
                                             set("coulomb_friction_nm", 0.0, 40, 80));
  EXPECT_NE(on_the_way.find("would break a rule at tick 40"), std::string::npos) << on_the_way;
}

// Catches: a file with more ramps at a time than the bench can follow.
TEST(ConfigEvents, AreLimitedToSixteenRampsAtATime) {
  std::string text = kBench;
  int count = 0;
  for (const Parameter& row : axis_parameters(parameters())) {
    if (!row.live || row.integer || count == 17) continue;
    text += "[[axis.set]]\nparameter = \"" + std::string(row.name) +
            "\"\nvalue = " + shortest(row.get(parameters())) + "\nat_tick = 1\nramp_ticks = 9\n";
    ++count;
  }
  ASSERT_EQ(count, 17);
  const std::string found = problems_of(text);
  EXPECT_NE(found.find("axis.set.parameter would be on its way together with 16 others"), std::string::npos)
      << found;
  text.replace(text.rfind("at_tick = 1"), 11, "at_tick = 10");
  EXPECT_EQ(problems_of(text), "none");
}

// Catches: a flood of events that fills the schedule of the bench.
TEST(ConfigEvents, AreBounded) {
  std::string text = kBench;
  for (int i = 0; i < 128; ++i)
    text += "[[axis.bump]]\nat_tick = 1\nimpulse_nms = 0\n";
  EXPECT_EQ(problems_of(text), "none");
  const std::string found = problems_of(text + "[[axis.load]]\nat_tick = 1\nload_nm = 0\n");
  EXPECT_NE(found.find(":6: axis.name has events that bring those of all axes to 129 but there may be 128"),
            std::string::npos)
      << found;
}

}  // namespace
}  // namespace drivebench::test::events_test
