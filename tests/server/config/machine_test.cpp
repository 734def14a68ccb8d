// Kinds of machine and drive, axes that share a shaft, and the substeps that suit them.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "protocols/document.hpp"
#include "server/config/config.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::machine_test {
namespace {

/// kBench with another machine; its keys begin at line 8.
std::string with_machine(const std::string& keys) {
  const std::size_t begin = kBench.find("pole_pairs");
  return std::string(kBench).replace(begin, kBench.find("[axis.mechanics]") - begin, keys);
}

const std::string kBldc =
    "kind = \"bldc\"\npole_pairs = 4\nstator_resistance_ohm = 0.5\nself_inductance_h = 1e-3\n"
    "mutual_inductance_h = 2e-4\ntorque_constant_nm_per_a = 0.05\n";

const std::string kShunt =
    "kind = \"shunt_dc\"\narmature_resistance_ohm = 1\narmature_inductance_h = 0.01\nmotor_constant = 1\n"
    "field_resistance_ohm = 100\nfield_inductance_h = 0\nsaturation_curve = [[0, 0], [1, 1], [2, 1.5]]\n";

// Catches: a kind that is ignored, and a kind that is taken without being named.
TEST(ConfigMachine, TheKindChoosesTheTable) {
  EXPECT_EQ(machine_kind(parse(kBench).setup.axes[0].parameters), "induction");
  EXPECT_EQ(machine_kind(
                parse(with_machine("kind = \"induction\"\n" +
                                   kBench.substr(kBench.find("pole_pairs"), kBench.find("[axis.mechanics]") -
                                                                                kBench.find("pole_pairs"))))
                    .setup.axes[0]
                    .parameters),
            "induction");
  const BenchConfig config = parse(with_machine(kBldc));
  const auto& machine = std::get<BldcMachineParameters>(config.setup.axes[0].parameters.machine);
  EXPECT_EQ(machine.pole_pairs, 4);
  EXPECT_EQ(machine.torque_constant_nm_per_a, 0.05);
  EXPECT_NE(physics_toml(config).find("[axis.machine]\nkind = \"bldc\"\npole_pairs = 4\n"),
            std::string::npos);
}

// Catches: a kind whose parameters, words or curves the canonical text loses.
TEST(ConfigMachine, OtherKindsAreWrittenAndReadBackBitForBit) {
  for (const std::string& machine : {kBldc, kShunt}) {
    BenchConfig config = parse(with_machine(machine));
    config.setup.axes[0].parameters.mechanics.motion = ShaftMotion::kImposed;
    expect_equal(parse(to_toml(config)), config);
    EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
    EXPECT_NE(to_toml(config).find("motion = \"imposed\"\n"), std::string::npos);
  }
}

// Catches: a choice whose words are not read, or that takes its numbers.
TEST(ConfigMachine, ChoicesAreWords) {
  const std::string drive = kBench + "[axis.drive]\nkind = ";
  EXPECT_EQ(parse(drive + "\"averaged_inverter\"\n").setup.axes[0].parameters.drive.kind,
            DriveKind::kAveraged);
  EXPECT_EQ(parse(kBench).setup.axes[0].parameters.drive.kind, DriveKind::kVoltage);
  EXPECT_EQ(problems_of(drive + "2\n").substr(0, 51), "b.toml:22: axis.drive.kind is 2 but must be one of ");
  EXPECT_EQ(problems_of(drive + "\"averaged\"\n"),
            "b.toml:22: axis.drive.kind is \"averaged\" but must be one of \"voltage_amplifier\", "
            "\"current_amplifier\", \"averaged_inverter\", \"switched_inverter\", \"source\"");
}

// Catches: keys of another kind that are taken, or a wrong kind that buries the user in unknown keys.
TEST(ConfigMachine, AWrongKindIsOneProblem) {
  const std::string found = problems_of(with_machine("kind = \"bldk\"\nself_inductance_h = 1\n"));
  EXPECT_EQ(found.substr(0, 64), "b.toml:8: axis.machine.kind is \"bldk\" but must be one of \"induct");
  EXPECT_EQ(found.find('\n'), std::string::npos) << found;
  EXPECT_EQ(problems_of(with_machine("kind = 3\npole_pairs = 1\n")).substr(0, 41),
            "b.toml:8: axis.machine.kind is 3 but must");
  EXPECT_NE(problems_of(with_machine(kBldc + "rotor_resistance_ohm = 3\n"))
                .find(":14: axis.machine.rotor_resistance_ohm is not a known key"),
            std::string::npos);
  EXPECT_NE(problems_of(with_machine("kind = \"bldc\"\n")).find(":7: axis.machine.pole_pairs is missing"),
            std::string::npos);
  EXPECT_NE(problems_of(with("pole_pairs = 3", "pole_pairs = 3\nmutual_inductance_m = 3"))
                .find(":9: axis.machine.mutual_inductance_m is not a known key; did you mean "
                      "\"mutual_inductance_h\"?"),
            std::string::npos);
}

// Catches: a motor file whose kind is lost, or a bench file that changes the kind.
TEST(ConfigMachine, TheMotorFileNamesTheKind) {
  const Folder folder;
  folder.write("m.toml", "name = \"m\"\nsource = \"s\"\n[machine]\n" + kBldc);
  const auto bench = [](const std::string& machine) {
    const std::size_t begin = kBench.find("[axis.machine]");
    return std::string(kBench).replace(begin, kBench.find("[axis.mechanics]") - begin,
                                       "motor = \"m.toml\"\n" + machine);
  };
  EXPECT_EQ(machine_kind(parse_config(bench(""), "b.toml", folder.path()).setup.axes[0].parameters), "bldc");
  EXPECT_EQ(
      std::get<BldcMachineParameters>(
          parse_config(bench("[axis.machine]\nkind = \"bldc\"\npole_pairs = 5\n"), "b.toml", folder.path())
              .setup.axes[0]
              .parameters.machine)
          .pole_pairs,
      5);
  EXPECT_EQ(problems_of(bench("[axis.machine]\nkind = \"induction\"\n"), folder.path()),
            "b.toml:9: axis.machine.kind is \"induction\" but the motor file says \"bldc\"");
  EXPECT_EQ(problems_of(bench("[axis.machine]\nself_inductance_h = 3\n")).find("known key"),
            std::string::npos)
      << "the kind of an unreadable motor file is unknown";
}

// ---- one shaft ----

/// kBrake with another name, on the shaft of another axis.
std::string named(std::string text, const std::string& own, const std::string& other) {
  text.replace(text.find("\"brake\""), 7, '"' + own + '"');
  return text.replace(text.find("\"x\""), 3, '"' + other + '"');
}

// Catches: an axis that turns alone, a canonical text that parts the two axes, a hash that misses the shaft.
TEST(ConfigShaft, TwoAxesShareOne) {
  const BenchConfig config = parse(kBench + kBrake);
  ASSERT_EQ(config.setup.axes.size(), 2u);
  EXPECT_FALSE(config.setup.axes[0].shares_shaft_with);
  EXPECT_EQ(config.setup.axes[1].shares_shaft_with, 0u);
  expect_equal(parse(to_toml(config)), config);
  EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
  BenchConfig apart = config;
  apart.setup.axes[1].shares_shaft_with.reset();
  EXPECT_NE(configuration_hash(apart), configuration_hash(config));
  BenchConfig three = parse(kBench + std::string(kBrake).replace(kBrake.find("shares"), 24, "") +
                            "[axis.mechanics]\ninertia_kgm2 = 1.1e-4\n" + named(kBrake, "third", "x"));
  const std::uint64_t on_the_first = configuration_hash(three);
  three.setup.axes[2].shares_shaft_with = 1;
  EXPECT_NE(configuration_hash(three), on_the_first);
  BenchConfig renamed = config;
  renamed.axes[0].name = "y";
  EXPECT_EQ(configuration_hash(renamed), configuration_hash(config)) << "names do not count";
}

// Catches: a motor file that is refused for the second axis because it contains an inertia.
TEST(ConfigShaft, TheMechanicsOfTheSecondMotorFileAreNotUsed) {
  const Folder folder;
  folder.write("m.toml",
               "name = \"m\"\nsource = \"s\"\n[machine]\n" + kBldc + "[mechanics]\ninertia_kgm2 = 3\n");
  const std::string brake = "[[axis]]\nname = \"brake\"\nmotor = \"m.toml\"\nshares_shaft_with = \"x\"\n" +
                            kBench.substr(kBench.find("[axis.amplifier]"));
  const BenchConfig config = parse_config(kBench + brake, "b.toml", folder.path());
  EXPECT_EQ(config.setup.axes[1].parameters.mechanics.inertia_kgm2, 1.1e-4);
  folder.write("m.toml",
               "name = \"m\"\nsource = \"s\"\n[machine]\n" + kBldc + "[mechanics]\ninertia_kgm2 = -3\n");
  EXPECT_NE(problems_of(kBench + brake, folder.path()).find("mechanics.inertia_kgm2 is -3"),
            std::string::npos);
}

// Catches: a chain of shafts, a third axis on a shaft, and settings for the shaft of another axis.
TEST(ConfigShaft, EachRuleIsKept) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {named(kBrake, "brake", "z"),
       ":23: axis.shares_shaft_with is \"z\" but no axis above this one has that name"},
      {named(kBrake, "brake", "brake"), ":23: axis.shares_shaft_with is \"brake\" but no axis above"},
      {kBrake + named(kBrake, "third", "brake"),
       ":38: axis.shares_shaft_with is \"brake\", which has no shaft of its own"},
      {kBrake + named(kBrake, "third", "x"),
       ":38: axis.shares_shaft_with is \"x\", whose shaft another axis shares already"},
      {kBrake + "[axis.mechanics]\ninertia_kgm2 = 1\n",
       ":36: axis.mechanics cannot stand beside shares_shaft_with: the shaft is that of the other axis"},
      {kBrake + "[[axis.set]]\nparameter = \"mechanics.inertia_kgm2\"\nvalue = 1\nat_s = 1\n",
       ":37: axis.set.parameter is \"mechanics.inertia_kgm2\", which belongs to the axis whose shaft"},
  };
  for (const auto& [text, said] : cases) {
    const std::string found = problems_of(kBench + text);
    EXPECT_NE(found.find("b.toml" + said), std::string::npos) << text << "\n  gave: " << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << text << "\n  gave more than one: " << found;
  }
  EXPECT_EQ(problems_of(with("name = \"x\"", "name = \"x\"\nshares_shaft_with = 1")).substr(0, 60),
            "b.toml:7: axis.shares_shaft_with is 1 but must be text in qu");
}

// ---- substeps ----

// Catches: an automatic number that ignores an axis, or that overrides the file's.
TEST(ConfigSubsteps, SuitTheAxisThatNeedsMost) {
  const auto needed = [](const AxisParameters& p) { return default_substeps(p, 125e-6); };
  const BenchConfig servo = parse(kBench);
  EXPECT_EQ(servo.setup.substeps, needed(servo.setup.axes[0].parameters));
  const std::string fast = std::string(kBldc).replace(kBldc.find("0.5"), 3, "9.5");
  const BenchConfig bldc = parse(with_machine(fast));
  ASSERT_NE(bldc.setup.substeps, servo.setup.substeps) << "else this test shows nothing";
  std::string second = with_machine(fast);
  second = second.substr(second.find("[[axis]]"));
  second.replace(second.find("\"x\""), 3, "\"y\"");
  EXPECT_EQ(parse(kBench + second).setup.substeps, std::max(servo.setup.substeps, bldc.setup.substeps));
  EXPECT_EQ(parse(with("125", "125\nsubsteps = 9")).setup.substeps, 9);
  EXPECT_NE(to_toml(servo).find("\nsubsteps = " + std::to_string(servo.setup.substeps) + "\n"),
            std::string::npos)
      << "a recording keeps it if the rule changes";
}

// Catches: a current loop that is run too seldom.
TEST(ConfigSubsteps, ACurrentLoopNeedsShortSteps) {
  const std::string loop =
      "[axis.drive]\nkind = \"current_amplifier\"\n[axis.current_loop]\nproportional_v_per_a = 10\nlimit_a = "
      "5\n";
  EXPECT_EQ(problems_of(kBench + loop), "none");
  EXPECT_EQ(parse(kBench + loop).setup.substeps, 7);
  EXPECT_EQ(problems_of(with("125", "125\nsubsteps = 6") + loop),
            "b.toml:5: bench.substeps comes to steps of 20.833333333333332 us, too long for the current loop "
            "of axis "
            "\"x\", which runs at each of them and needs 20 us: at least 7 substeps are needed");
  EXPECT_EQ(problems_of(with("125", "100\nsubsteps = 5") + loop), "none");
  const std::string slow = problems_of(with("125", "2000") + loop);
  EXPECT_NE(slow.find(":4: bench.period_us comes to steps of 31.25 us"), std::string::npos) << slow;
  EXPECT_NE(slow.find("even 64 substeps would need a period_us of at most 1280"), std::string::npos) << slow;
}

}  // namespace
}  // namespace drivebench::test::machine_test
