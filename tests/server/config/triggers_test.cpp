#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "server/config/config.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::triggers_test {
namespace {

const std::string kFault = "[[axis.fault]]\nname = \"open_phase\"\nvalue = 2\n";
const std::string kWhen = "when = \"speed_rad_s > 100\"\n";

std::vector<std::string> texts_of(const BenchConfig& config) {
  Bench bench(config.setup);
  schedule_events(config, bench);
  std::vector<std::string> texts;
  for (const EventState& event : event_states(config, bench))
    texts.push_back(event.text);
  return texts;
}

// Catches: a time in seconds that is cut, an end that counts from elsewhere, an event without its condition.
TEST(ConfigTriggers, EveryKindOfEventMayWait) {
  const BenchConfig config = parse(
      kBench + "[[axis.load]]\nload_nm = 0.5\nramp_s = 0.01\n" + kWhen +
      "[[axis.set]]\nparameter = \"amplifier.gain\"\nvalue = 1.5\nwhen = \"state == 1\"\ndelay_ticks = 3\n" +
      kFault + kWhen + "for_s = 0.005\ndelay_s = 0.0011\nlasts_s = 0.01\n" +
      "[[axis.bump]]\nimpulse_nms = 0.1\nwhen = \"faults & 4 != 0\"\n"
      "[[axis.load]]\nload_nm = 1\nat_tick = 9\n");
  EXPECT_EQ(texts_of(config), (std::vector<std::string>{
                                  "load 1 N*m at tick 9",
                                  "load 0.5 N*m in a ramp of 80 ticks when speed_rad_s > 100",
                                  "bump 0.1 N*m*s when faults & 4 != 0",
                                  "amplifier.gain = 1.5 3 ticks after state == 1",
                                  "fault open_phase = 2 9 ticks after speed_rad_s > 100 for 40 ticks",
                                  "fault open_phase = 0 89 ticks after speed_rad_s > 100 for 40 ticks",
                              }));
}

// Catches: a trigger that the canonical text loses or changes, as the recording's copy of the bench would.
TEST(ConfigTriggers, AreWrittenAndReadBack) {
  const std::string text = kBench + kFault + kWhen + "for_ticks = 4\ndelay_ticks = 2\n";
  const BenchConfig config = parse(text);
  const BenchConfig again = parse(to_toml(config));
  expect_equal(again, config);
  EXPECT_EQ(texts_of(again), texts_of(config));
  EXPECT_EQ(configuration_hash(again), configuration_hash(config));
}

// Catches: a hash that is blind to the parts of a trigger.
TEST(ConfigTriggers, TheHashDependsOnEachPart) {
  std::vector<std::uint64_t> hashes;
  for (const std::string& when :
       {kWhen, std::string("when = \"speed_rad_s >= 100\"\n"), std::string("when = \"speed_rad_s > 101\"\n"),
        std::string("when = \"load_nm > 100\"\n"), std::string("when = \"state & 1 == 1\"\n"),
        std::string("when = \"state & 3 == 1\"\n"), kWhen + "for_ticks = 1\n", kWhen + "delay_ticks = 1\n",
        std::string("at_tick = 0\n")}) {
    hashes.push_back(configuration_hash(parse(kBench + kFault + when)));
  }
  for (std::size_t i = 0; i < hashes.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_NE(hashes[i], hashes[j]) << i << " " << j;
  }
}

// Catches: a rule that is not checked, one by one.
TEST(ConfigTriggers, EachRuleIsKept) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"when = \"sped_rad_s > 1\"\n",
       "axis.fault.when is \"sped_rad_s > 1\" but there is no signal 'sped_rad_s'; did you mean "
       "'speed_rad_s'?"},
      {"when = \"other.speed_rad_s > 1\"\n",
       "axis.fault.when is \"other.speed_rad_s > 1\" but the bench has no axis"},
      {"at_s = 1\nwhn = \"speed_rad_s > 1\"\n", "axis.fault.whn is not a known key; did you mean \"when\""},
      {"when = 5\n", "axis.fault.when is 5 but must be"},
      {kWhen + "at_s = 1\n", "axis.fault.at_s cannot stand beside when"},
      {kWhen + "until_s = 1\n", "axis.fault.until_s cannot stand beside when"},
      {kWhen + "lasts_ticks = 0\n", "axis.fault.lasts_ticks comes to 0 ticks but must come to at least 1"},
      {kWhen + "for_s = -1\n", "axis.fault.for_s is -1 but must lie"},
      {kWhen + "for_s = 1\nfor_ticks = 1\n", "axis.fault.for_ticks cannot stand beside for_s"},
      {"at_s = 1\nfor_s = 1\n", "axis.fault.for_s belongs to when, which is missing"},
      {"at_s = 1\ndelay_ticks = 1\n", "axis.fault.delay_ticks belongs to when, which is missing"},
      {"at_s = 1\nlasts_s = 1\n", "axis.fault.lasts_s belongs to when, which is missing"},
  };
  for (const auto& [text, said] : cases) {
    const std::string found = problems_of(kBench + kFault + text);
    EXPECT_NE(found.find(said), std::string::npos) << text << "  gave: " << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << text << "  gave more than one: " << found;
  }
}

// Catches: an event that shows as done before its tick has run, or never.
TEST(ConfigTriggers, TheStateOfAnEventFollowsTheRun) {
  const BenchConfig config = parse(kBench + "[[axis.load]]\nload_nm = 1\nat_tick = 3\n" + kFault +
                                   "when = \"load_nm > 0.5\"\ndelay_ticks = 2\nlasts_ticks = 4\n");
  Bench bench(config.setup);
  schedule_events(config, bench);
  const auto acted = [&] {
    std::vector<Tick> ticks;
    for (const EventState& event : event_states(config, bench))
      ticks.push_back(event.acted.value_or(-1));
    return ticks;
  };
  const std::vector<std::pair<int, std::vector<Tick>>> expected = {{3, {-1, -1, -1}}, {4, {3, -1, -1}},
                                                                   {6, {3, -1, -1}},  {7, {3, 6, -1}},
                                                                   {10, {3, 6, -1}},  {11, {3, 6, 10}}};
  for (const auto& [tick, ticks] : expected) {
    while (bench.tick() < tick)
      bench.step();
    EXPECT_EQ(acted(), ticks) << "before tick " << tick;
  }
}

}  // namespace
}  // namespace drivebench::test::triggers_test
