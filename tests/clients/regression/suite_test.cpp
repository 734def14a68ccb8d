#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/suite/compose.hpp"
#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"

namespace drivebench::regression {
namespace {

namespace fs = std::filesystem;

/// A folder with files, removed at the end.
class Suite : public testing::Test {
 protected:
  Suite() { fs::create_directories(folder_); }
  ~Suite() override { fs::remove_all(folder_); }

  fs::path file(const std::string& name, const std::string& text) {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string problems_with(const std::string& text) {
    file("case.toml", text);
    try {
      read_suite(folder_);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "none";
  }
  Case the_case(const std::string& text) { return read_suite(file("case.toml", text)).front(); }

  fs::path folder_ = fs::temp_directory_path() / ("drivebench-suite-" + std::to_string(::getpid()));
};

constexpr const char* kWhole = R"(
bench = "servo"
duration_s = 0.5
[[step]]
name = "late"
at_s = 0.1
load_nm = 0.1
[[check]]
kind = "bounds"
signal = "i_a_a"
abs = 6
)";

std::string without_name(std::string text) {
  return text.erase(text.find("name = \"late\"\n"), 14);
}

// Catches: axes that do not multiply, values out of order, a name that does not tell the values.
TEST_F(Suite, AMatrixMultipliesItsListsAndRanges) {
  const auto cases = read_suite(file("a/load.toml", without_name(kWhole) + R"([matrix]
step.0.load_nm = [0.1, 0.2]
seed = {from = 1, to = 3}
"check.0.abs" = {from = 5.0, to = 6.0, count = 2}
)"));
  ASSERT_EQ(cases.size(), 12U);
  EXPECT_EQ(cases[0].name, "load[load_nm=0.1, seed=1, abs=5.0]");
  EXPECT_EQ(cases[1].name, "load[load_nm=0.1, seed=1, abs=6.0]");
  EXPECT_EQ(cases[11].name, "load[load_nm=0.2, seed=3, abs=6.0]");
  EXPECT_EQ(cases[11].seed, 3);
  EXPECT_EQ(number_in(cases[11].steps[0].value), 0.2);
  EXPECT_EQ(cases[11].checks[0].number("abs"), 6.0);
  EXPECT_EQ(read_suite(folder_).front().name, "a/load[load_nm=0.1, seed=1, abs=5.0]");
}

// Catches: a drawn value that another draw, key or count moves, one outside its distribution, a name that
// does not tell the values that ran.
TEST_F(Suite, DrawsDependOnTheirSeedKeyAndNumberAlone) {
  const auto drawn = [this](const std::string& count, const std::string& more) {
    return read_suite(
        file("case.toml",
             without_name(kWhole) + "[matrix]\n\"check.0.abs\" = [5.0, 6.0]\n[draw]\ncount = " + count +
                 "\nseed = 7\n[draw.of]\nstep.0.load_nm = {normal = [0.1, 0.05], min = 0.0}\n" + more));
  };
  const auto few = drawn("3", "");
  const auto many = drawn(
      "2000",
      "seed = {integer = [1, 4]}\noverride.axis.0.mechanics.inertia_kgm2 = {log_uniform = [1e-5, 1e-3]}\n");
  ASSERT_EQ(few.size(), 6U);
  ASSERT_EQ(many.size(), 4000U);
  EXPECT_EQ(few[1].name, "case[abs=5.0, draw=1, load_nm=" + few[1].values[2].second + "]");
  EXPECT_EQ(few[5].name, "case[abs=6.0, draw=2, load_nm=" + few[2].values[2].second + "]");
  double sum = 0.0;
  double squares = 0.0;
  std::array<int, 5> seeds{};
  for (std::size_t i = 0; i < 2000; ++i) {
    const double load = number_in(many[i].steps[0].value).value();
    EXPECT_GE(load, 0.0);
    EXPECT_EQ(std::stod(many[i].values[2].second), load);
    sum += load;
    squares += load * load;
    ++seeds.at(static_cast<std::size_t>(many[i].seed.value()));
  }
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_EQ(number_in(few[i].steps[0].value), number_in(many[i].steps[0].value));
  // A normal distribution without its part below -2 standard deviations: mean 0.10276, deviation 0.04710;
  // four standard errors.
  EXPECT_NEAR(sum / 2000.0, 0.10276, 0.0042);
  EXPECT_NEAR(std::sqrt(squares / 2000.0 - sum * sum / 4e6), 0.04710, 0.004);
  for (std::size_t seed = 1; seed < seeds.size(); ++seed)
    EXPECT_NEAR(seeds.at(seed), 500, 80) << seed;
}

// Catches: a draw that depends on the machine: the standard leaves distributions to the library.
TEST_F(Suite, ADrawHasTheSameValuesEverywhere) {
  const auto cases = read_suite(file("case.toml", without_name(kWhole) + R"([draw]
count = 2
[draw.of]
step.0.load_nm = {uniform = [0.0, 1.0]}
seed = {integer = [1, 1000]}
"override.axis.0.machine.current_gain" = {normal = [1.0, 0.01]}
"override.axis.0.mechanics.inertia_kgm2" = {log_uniform = [1e-5, 1e-3]}
"check.0.abs" = {one_of = [5.0, 6.0, 7.0]}
)"));
  EXPECT_EQ(
      cases[0].name,
      "case[draw=0, load_nm=0.670099, seed=932, current_gain=0.99934, inertia_kgm2=5.45106e-05, abs=5.0]");
  EXPECT_EQ(
      cases[1].name,
      "case[draw=1, load_nm=0.375457, seed=324, current_gain=1.00456, inertia_kgm2=0.000167523, abs=5.0]");
}

// Catches: labels that are the same for two axes of the matrix.
TEST_F(Suite, LabelsAreAsLongAsTheyMustBe) {
  const auto cases = read_suite(file("case.toml", without_name(kWhole) + R"([matrix]
override.axis.0.machine.rotor_resistance_ohm = [3.9]
override.axis.0.mechanics.inertia_kgm2 = [1.1e-4]
override.axis.1.mechanics.inertia_kgm2 = [1.1e-4]
)"));
  ASSERT_EQ(cases.size(), 1U);
  EXPECT_EQ(
      cases[0].name,
      "case[rotor_resistance_ohm=3.9, 0.mechanics.inertia_kgm2=0.00011, 1.mechanics.inertia_kgm2=0.00011]");
}

// Catches: a mistake that runs all the same, or is told without its line.
TEST_F(Suite, MistakesAreToldWithFileLineAndAdvice) {
  const auto has = [this](const std::string& text, std::string_view part) {
    const std::string problems = problems_with(text);
    EXPECT_NE(problems.find(part), std::string::npos) << problems;
  };
  const std::string whole = without_name(kWhole);
  EXPECT_EQ(problems_with(whole), "none");
  has(kWhole, "case.toml:5: step[0].name is no key here");
  has(whole + "[dut]\npresets = \"x\"", "dut.presets is no key here; did you mean \"preset\"?");
  has(whole + "[dut]\npreset = \"x\"\ncommand = [\"y\"]", "dut.command cannot stand beside preset");
  has("bench = \"servo\"\nduration_s = 1", "check is missing: a case without checks proves nothing");
  has("bench = \"servo\"\n[[check]]\nkind = \"never\"\ncondition = \"state == 4\"", "duration_s is missing");
  has(whole + "[[check]]\nkind = \"bounds\"\nsignal = \"i_a_a\"\nabs = 7",
      "has two of the name \"bounds i_a_a\"");
  has(whole + "[[step]]\nat_s = 1\nload_nm = 1\nimpulse_nms = 1", "exactly one; here are 2");
  has(whole + "[[step]]\nload_nm = 1", "or else when must stand in a step");
  has(whole + "[[step]]\nat_s = 1\nfault = \"open_phase\"", "value is missing");
  has(whole + "[[step]]\nat_s = 1\nfor_s = 1\nload_nm = 1", "for_s belongs to when");
  has(whole + "[[step]]\nwhen = \"speed > 1\"\nload_nm = 1", "did you mean 'speed_rad_s'?");
  has(whole + "[matrix]\nstep.4.load_nm = [1]", "matrix.step.4.load_nm names no place in this case");
  has(whole + "[matrix]\nseed = 4", "must be a list, [1, 2], or a range");
  has(whole + "[matrix]\nseed = {from = 1, to = 1e9, step = 1e-3}", "makes more than 1000000 values");
  has(whole + "[matrix]\nsed = [4]", "sed is no key here; did you mean \"seed\"?");
  has(whole + "[draw]\ncount = 2", "draw.of is missing");
  has(whole + "[draw]\ncount = 0\n[draw.of]\nseed = {integer = [1, 2]}",
      "draw.count is 0 but must be a whole number from 1");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = 4", "draw.of.seed is 4 but must be a distribution");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = {uniform = [2, 1]}",
      "draw.of.seed.uniform must be two rising numbers");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = {normal = [2, 0]}",
      "must be a mean and a standard deviation above 0");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = {integer = [1, 2.5]}", "must be two whole numbers");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = {uniform = [1, 2], min = 1}",
      "draw.of.seed.min is no key here");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = {normal = [0, 1], min = 40}",
      "has next to no values between");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nseed = {one_of = []}", "draw.of.seed.one_of must be a list");
  has(whole + "[draw]\ncount = 2\n[draw.of]\nstep.4.load_nm = {uniform = [1, 2]}",
      "draw.of.step.4.load_nm names no place in this case");
  has(whole +
          "[matrix]\nseed = {from = 1, to = 100}\n[draw]\ncount = 20000\n[draw.of]\n\"check.0.abs\" = "
          "{uniform = [1, 2]}",
      "has, with the draws, 2000000 combinations");
  has("bench = [", "case.toml:1");
}

// Catches: a case of a folder that is left out, or an empty folder that passes.
TEST_F(Suite, AFolderIsReadWholeAndInOrder) {
  EXPECT_NE(problems_with("x").find("case.toml:1"), std::string::npos);
  fs::remove_all(folder_);
  fs::create_directories(folder_);
  EXPECT_THROW(read_suite(folder_), ConfigError);
  file("b.toml", without_name(kWhole));
  file("a/c.toml", without_name(kWhole));
  file("readme.txt", "no case");
  const auto cases = read_suite(folder_);
  ASSERT_EQ(cases.size(), 2U);
  EXPECT_EQ(cases[0].name, "a/c");
  EXPECT_EQ(cases[1].name, "b");
}

// Catches: a document that is not the same after it was written.
TEST(TomlText, ReadsBackAsItWas) {
  const std::string text =
      "a = 1\nb = 1.0\nc = \"say \\\"x\\\" \\\\\"\nd = [[0.0, 1.0], [2.5, -3e-07]]\ne = true\n\"f g\" = "
      "0x1a\n"
      "\n[h]\ni = 2\n\n[h.j]\nk = \"l\"\n\n[[m]]\nn = 1\n\n[[m.o]]\np = 2\n\n[[m]]\nn = 2\n";
  ProblemList problems;
  const auto node = parse_document(text, "t", problems);
  ASSERT_TRUE(node.has_value());
  EXPECT_EQ(toml_text(*node), text);
}

constexpr const char* kBench = R"(
[bench]
name = "x"
mode = "realtime"
period_us = 100
[tcp]
port = 7300
[[can]]
backend = "udp_multicast"
[[axis]]
name = "first"
motor = "motors/m.toml"
[axis.machine]
rotor_resistance_ohm = 1.0
[[axis.load]]
at_s = 0.5
load_nm = 1.0
[[axis]]
name = "second"
motor = "motors/m.toml"
shares_shaft_with = "first"
)";

class Compose : public Suite {
 protected:
  Compose() {
    bench_ = file("bench.toml", kBench);
    file("motors/m.toml",
         "name = \"M\"\nsource = \"s\"\n[machine]\nkind = \"induction\"\nrotor_resistance_ohm = 2.0\n"
         "pole_pairs = 3\n[mechanics]\ninertia_kgm2 = 0.1\n");
  }

  ConfigNode composed(const std::string& keys) {
    const Case c = the_case("bench = \"b\"\nduration_s = 1\n" + keys +
                            "\n[[check]]\nkind = \"never\"\ncondition = \"state == 4\"\n");
    ProblemList problems;
    text_ = composed_bench(c, bench_);
    return *parse_document(text_, "composed", problems);
  }
  std::string refusal(const std::string& keys) {
    try {
      composed(keys);
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "none";
  }
  static const ConfigNode& at(const ConfigNode& node, const std::vector<std::string>& path) {
    const ConfigNode* place = &node;
    for (const std::string& key : path) {
      place = place->kind == ConfigNode::Kind::kArray ? &place->children.at(std::stoul(key))
                                                      : find_child(*place, key);
      if (place == nullptr) throw std::runtime_error("no " + key);
    }
    return *place;
  }

  fs::path bench_;
  std::string text_;
};

// Catches: a motor that overrides its bench, a file that the composed bench still needs, a bus that two cases
// would share.
TEST_F(Compose, TheComposedBenchNeedsNoOtherFile) {
  const ConfigNode bench = composed("");
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "machine", "rotor_resistance_ohm"})), 1.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "machine", "rotor_resistance_ohm"})), 2.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "machine", "pole_pairs"})), 3.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "mechanics", "inertia_kgm2"})), 0.1);
  EXPECT_EQ(find_child(at(bench, {"axis", "1"}), "mechanics"), nullptr);  // those of the first
  EXPECT_EQ(find_child(at(bench, {"axis", "0"}), "motor"), nullptr);
  EXPECT_EQ(find_child(bench, "can"), nullptr);
  EXPECT_EQ(find_child(bench, "tcp"), nullptr);
}

// Catches: a bench in real time that would lose its delay of a tick in lockstep.
TEST_F(Compose, LockstepKeepsTheDelayOfRealTime) {
  const ConfigNode bench = composed("seed = 7");
  EXPECT_EQ(std::get<std::string>(at(bench, {"bench", "mode"}).scalar), "lockstep");
  EXPECT_EQ(number_in(at(bench, {"bench", "command_delay_ticks"})), 1.0);
  EXPECT_EQ(number_in(at(bench, {"bench", "arming_commands"})), 10.0);
  EXPECT_EQ(number_in(at(bench, {"bench", "seed"})), 7.0);
}

// Catches: an override of the wrong axis, one that drops its neighbours, one of an axis that is not there.
TEST_F(Compose, OverridesMergeIntoTheAxisByNameOrNumber) {
  const ConfigNode bench = composed(
      "[override.bench]\nsubsteps = 4\n[override.axis.second.machine]\nrotor_resistance_ohm = 3.0\n"
      "[override.axis.0.encoder]\ncounts_per_revolution = 4000");
  EXPECT_EQ(number_in(at(bench, {"bench", "substeps"})), 4.0);
  EXPECT_EQ(number_in(at(bench, {"bench", "period_us"})), 100.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "machine", "rotor_resistance_ohm"})), 1.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "machine", "rotor_resistance_ohm"})), 3.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "encoder", "counts_per_revolution"})), 4000.0);
  EXPECT_NE(refusal("[override.axis.thrid.machine]\nx = 1").find("no axis of the bench"), std::string::npos);
}

// Catches: a step on the wrong axis, in the wrong table, or that replaces the bench's own events.
TEST_F(Compose, StepsAtATimeAreScheduledEvents) {
  const ConfigNode bench = composed(
      "[[step]]\nat_s = 0.1\nload_nm = 0.2\nramp_s = 0.05\n[[step]]\nat_s = 0.2\naxis = \"second\"\nfault = "
      "\"open_phase\"\nvalue = 2\n[[step]]\nat_s = 0.3\nimpulse_nms = 0.01\n[[step]]\nat_s = 0.4\nparameter "
      "= \"a.b\"\n"
      "value = \"word\"");
  const ConfigNode& loads = at(bench, {"axis", "0", "load"});
  ASSERT_EQ(loads.children.size(), 2U);
  EXPECT_EQ(number_in(at(loads, {"0", "load_nm"})), 1.0);
  EXPECT_EQ(number_in(at(loads, {"1", "load_nm"})), 0.2);
  EXPECT_EQ(number_in(at(loads, {"1", "ramp_s"})), 0.05);
  EXPECT_EQ(std::get<std::string>(at(bench, {"axis", "1", "fault", "0", "name"}).scalar), "open_phase");
  EXPECT_TRUE(std::holds_alternative<std::int64_t>(at(bench, {"axis", "1", "fault", "0", "value"}).scalar));
  EXPECT_EQ(number_in(at(bench, {"axis", "0", "bump", "0", "impulse_nms"})), 0.01);
  EXPECT_EQ(std::get<std::string>(at(bench, {"axis", "0", "set", "0", "value"}).scalar), "word");
  EXPECT_NE(refusal("[[step]]\nat_s = 0\naxis = \"9\"\nload_nm = 1").find("step.axis is \"9\""),
            std::string::npos);
}

// Catches: a multisine that does not reach the bench, a check that measures another step or the first period.
TEST_F(Compose, AMultisineIsAnEventThatChecksKnow) {
  const std::string sum = "periods = 5, period_s = 0.2, from_hz = 5.0, to_hz = 400.0}\n";
  const std::string step = "[[step]]\nat_s = 0.1\naxis = \"second\"\nmultisine = {load_nm = 0.01, " + sum;
  const std::string check =
      "[[check]]\nkind = \"frequency_response\"\nname = \"loop\"\nmin_gain_margin_db = 6\n";
  const ConfigNode bench = composed(step + check);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "multisine", "0", "to_hz"})), 400.0);
  EXPECT_EQ(number_in(at(bench, {"axis", "1", "multisine", "0", "at_s"})), 0.1);
  const auto read = [this](const std::string& keys) {
    return the_case("bench = \"b\"\nduration_s = 2\n" + keys);
  };
  const Case c = read(step + check);
  const CheckSpec& spec = c.checks.back();
  EXPECT_EQ(spec.axis, "second");
  EXPECT_EQ(spec.from_s, 0.1 + 0.2);
  EXPECT_EQ(spec.to_s, 0.1 + 5 * 0.2);
  ASSERT_TRUE(spec.excitation);
  EXPECT_TRUE(spec.excitation->is_load);
  EXPECT_NE(refusal(check).find("\"loop\" (line "), std::string::npos);
  EXPECT_NE(refusal(check).find("needs a step with a multisine"), std::string::npos);
  EXPECT_NE(refusal(step + step + check).find("needs the number of its step"), std::string::npos);
  EXPECT_EQ(read(step + step + check + "step = 1\n").checks.back().axis, "second");
  EXPECT_NE(refusal(step + check + "step = 4\n").find("has step 4, which is no step"), std::string::npos);
  const std::string offset = "[[step]]\nat_s = 0.1\nmultisine = {current_offset_a = 0.01, " + sum;
  EXPECT_NE(refusal(offset + "[[step]]\nat_s = 0.2\nfault = \"current_sensor_offset\"\nvalue = 1.0\n" + check)
                .find("has a second step that changes the offset"),
            std::string::npos);
}

// Catches: a condition that is lost, or that acts on another axis than it should.
TEST_F(Compose, StepsOnAConditionWaitInTheBench) {
  const ConfigNode bench = composed(
      "[[step]]\nwhen = \"speed_rad_s > 100\"\naxis = \"1\"\nfor_s = 0.005\ndelay_s = 0.01\nfault = "
      "\"open_phase\"\n"
      "value = 2");
  const ConfigNode& event = at(bench, {"axis", "1", "fault", "0"});
  EXPECT_EQ(std::get<std::string>(at(event, {"when"}).scalar), "speed_rad_s > 100");
  EXPECT_EQ(std::get<std::string>(at(event, {"name"}).scalar), "open_phase");
  EXPECT_EQ(number_in(at(event, {"for_s"})), 0.005);
  EXPECT_EQ(number_in(at(event, {"delay_s"})), 0.01);
}

}  // namespace
}  // namespace drivebench::regression
