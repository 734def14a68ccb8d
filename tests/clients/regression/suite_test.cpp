#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "clients/regression/suite/case_file.hpp"
#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"
#include "tests/clients/regression/suite_folder.hpp"

namespace drivebench::regression::suite_test {
namespace {

namespace fs = std::filesystem;

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

// Catches: two cases of which one has the result, or the bundle, of the other.
TEST_F(Suite, NoTwoCasesHaveOneName) {
  EXPECT_NE(problems_with(without_name(kWhole) + "[matrix]\nseed = [1, 2, 1]\n")
                .find("makes a second case of the name \"case[seed=1]\""),
            std::string::npos);
  file("case.toml", without_name(kWhole));
  file("a_b.toml", without_name(kWhole));
  EXPECT_EQ(read_suite(folder_).size(), 2U);
  file("a/b.toml", without_name(kWhole));
  EXPECT_THROW(read_suite(folder_), ConfigError);
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

}  // namespace
}  // namespace drivebench::regression::suite_test
