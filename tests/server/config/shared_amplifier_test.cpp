// Axes that share an amplifier.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "server/config/config.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::shared_amplifier_test {
namespace {

/// A second axis on the amplifier of the first.
const std::string kTwin = [] {
  std::string text = "[[axis]]\nname = \"twin\"\nshares_amplifier_with = \"x\"\n" +
                     kBench.substr(kBench.find("[axis.machine]"));
  const std::size_t amplifier = text.find("[axis.amplifier]");
  return text.erase(amplifier, text.find("[axis.", amplifier + 1) - amplifier);
}();

/// kTwin with another name, on the amplifier of another axis.
std::string twin(const std::string& own, const std::string& other) {
  std::string text = kTwin;
  text.replace(text.find("\"twin\""), 6, '"' + own + '"');
  return text.replace(text.find("\"x\""), 3, '"' + other + '"');
}

// Catches: a second axis with a drive of its own, a canonical text that parts the two axes, a hash that
// misses the amplifier, one that changes for benches without one.
TEST(ConfigAmplifier, TwoAxesShareOne) {
  const BenchConfig config = parse(kBench + kTwin);
  ASSERT_EQ(config.setup.axes.size(), 2u);
  EXPECT_FALSE(config.setup.axes[0].shares_amplifier_with);
  EXPECT_EQ(config.setup.axes[1].shares_amplifier_with, 0u);
  EXPECT_EQ(config.setup.axes[1].parameters.drive.amplifier.voltage_limit_v,
            config.setup.axes[0].parameters.drive.amplifier.voltage_limit_v);
  expect_equal(parse(to_toml(config)), config);
  EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
  BenchConfig apart = config;
  apart.setup.axes[1].shares_amplifier_with.reset();
  EXPECT_NE(configuration_hash(apart), configuration_hash(config));
  BenchConfig renamed = config;
  renamed.axes[0].name = "y";
  EXPECT_EQ(configuration_hash(renamed), configuration_hash(config)) << "names do not count";
}

// Catches: a chain of amplifiers, a third axis on one, settings for the drive of another axis, a pair on a
// shaft and on an amplifier at once, machines that cannot be in parallel.
TEST(ConfigAmplifier, EachRuleIsKept) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {twin("twin", "z"), "axis.shares_amplifier_with is \"z\" but no axis above this one has that name"},
      {kTwin + twin("third", "twin"),
       "axis.shares_amplifier_with is \"twin\", which has no amplifier of its own"},
      {kTwin + twin("third", "x"),
       "axis.shares_amplifier_with is \"x\", whose amplifier another axis shares already"},
      {kTwin + kBrake, "axis.shares_shaft_with is \"x\", which shares its amplifier with another axis"},
      {kBrake + twin("twin", "x"),
       "axis.shares_amplifier_with is \"x\", which shares its shaft with another axis"},
      {kTwin + "[axis.amplifier]\ngain = 1\n",
       "axis.amplifier cannot stand beside shares_amplifier_with: the drive is that of the other axis"},
      {kTwin + "[axis.drive]\nkind = \"averaged_inverter\"\n",
       "axis.drive cannot stand beside shares_amplifier_with"},
      {std::string(kTwin).insert(kTwin.find("[axis.machine]"), "on_link_loss = \"hold\"\n"),
       "axis.on_link_loss cannot stand beside shares_amplifier_with: the commands are those of the other "
       "axis"},
      {std::string(kTwin).insert(kTwin.find("[axis.machine]"), "slew_per_s = 1\n"),
       "axis.slew_per_s cannot stand beside shares_amplifier_with"},
      {kTwin + "[[axis.set]]\nparameter = \"amplifier.gain\"\nvalue = 1\nat_s = 1\n",
       "axis.set.parameter is \"amplifier.gain\", which belongs to the axis whose amplifier"},
      {kTwin + "[[axis.fault]]\nname = \"bus_sag\"\nvalue = 0.5\nat_s = 1\n",
       "axis.fault.name is \"bus_sag\", a fault of the axis whose amplifier this one shares"},
  };
  for (const auto& [text, said] : cases) {
    const std::string found = problems_of(kBench + text);
    EXPECT_NE(found.find(said), std::string::npos) << text << "\n  gave: " << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << text << "\n  gave more than one: " << found;
  }
}

// Catches: a drive whose output depends on one machine's currents, at the start or by an event; windings that
// are connected differently.
TEST(ConfigAmplifier, TheDriveAndTheWindingsMustSuitBoth) {
  const auto with_first = [](const std::string& more) { return kBench + more + kTwin; };
  const std::vector<std::pair<std::string, std::string>> cases = {
      {with_first("[axis.drive]\nkind = \"source\"\n"),
       "axis.shares_amplifier_with is \"x\", whose drive.kind is \"source\" but two machines share voltage "
       "amplifiers and inverters only"},
      {with_first("[[axis.set]]\nparameter = \"amplifier.filter_hz\"\nvalue = 100\nat_s = 1\n"),
       "axis.shares_amplifier_with is \"x\", whose amplifier.filter_hz is 100 but must be 0 where two "
       "machines "
       "share the amplifier"},
      {kBench + std::string(kTwin).insert(kTwin.find("[axis.machine]") + 15, "star = true\n"),
       "axis.shares_amplifier_with is \"x\", whose windings are connected differently"},
  };
  for (const auto& [text, said] : cases) {
    const std::string found = problems_of(text);
    EXPECT_NE(found.find(said), std::string::npos) << text << "\n  gave: " << found;
  }
}

}  // namespace
}  // namespace drivebench::test::shared_amplifier_test
