#include "server/config/sections/curves.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "protocols/text.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::curves_test {
namespace {

/// kBench with this value for the curve of the load torque over time.
std::string with_profile(const std::string& value) {
  return with("inertia_kgm2 = 1.1e-4\n", "inertia_kgm2 = 1.1e-4\nload_profile = " + value + "\n");
}

const std::vector<CurvePoint>& profile_of(const BenchConfig& config) {
  return config.setup.axes[0].parameters.mechanics.load_profile.points();
}

// Catches: points that are lost, cut or swapped on their way, and a curve that the canonical text or the hash
// forgets.
TEST(ConfigCurves, PointsAreReadWrittenAndHashedBitForBit) {
  const BenchConfig config = parse(with_profile("[[0, 1], [0.1, -0.0],\n [0.30000000000000004, 5e-324]]"));
  expect_equal(profile_of(config), std::vector<CurvePoint>{{0.0, 1.0}, {0.1, -0.0}, {0.1 + 0.2, 5e-324}});
  expect_equal(parse(to_toml(config)), config);
  EXPECT_EQ(to_toml(parse(to_toml(config))), to_toml(config));
  EXPECT_NE(configuration_hash(config), configuration_hash(parse(kBench)));
  EXPECT_NE(configuration_hash(config),
            configuration_hash(parse(with_profile("[[0, 1], [0.1, 0.0], [0.30000000000000004, 5e-324]]"))));
  EXPECT_TRUE(parse(kBench).setup.axes[0].parameters.mechanics.load_profile.empty());
}

// Catches: a file that is looked for in the wrong folder, a header taken for a point, foreign line ends.
TEST(ConfigCurves, AFileOfTwoColumnsIsRead) {
  const Folder folder;
  for (const std::string text : {"0,1\n0.5,-2e-3\n", "time [s],torque [N*m]\n0,1\n0.5,-2e-3",
                                 "\xef\xbb\xbft,y\r\n0 , +1\r\n\r\n 0.5,\t-2e-3\r\n",
                                 "\xef\xbb\xbf"
                                 "0,1\n0.5,-2e-3\n",
                                 "\n\n0,1.0\n5e-1,-0.002\n\n"}) {
    folder.write("profile.csv", text);
    const BenchConfig config = parse_config(with_profile("\"profile.csv\""), "b.toml", folder.path());
    expect_equal(profile_of(config), std::vector<CurvePoint>{{0.0, 1.0}, {0.5, -2e-3}});
    expect_equal(parse_config(to_toml(config), "bench.toml", {}), config);
  }
}

// Catches: a curve of a motor file that is looked for beside the bench file.
TEST(ConfigCurves, AFileIsNamedRelativeToTheFileThatNamesIt) {
  const Folder folder;
  fs::create_directories(folder.path() / "motors");
  folder.write("motors/p.csv", "0,1\n1,2\n");
  folder.write("p.csv", "0,1\n1,3\n");
  folder.write("motors/m.toml",
               "name = \"m\"\nsource = \"s\"\n[mechanics]\ninertia_kgm2 = 1\nload_profile = \"p.csv\"\n");
  const std::string bench = with("[axis.mechanics]\ninertia_kgm2 = 1.1e-4\n", "")
                                .insert(kBench.find("[axis.machine]"), "motor = \"motors/m.toml\"\n");
  EXPECT_EQ(profile_of(parse_config(bench, "b.toml", folder.path()))[1].y, 2.0);
  const std::string own = bench + "[axis.mechanics]\nload_profile = \"p.csv\"\n";
  EXPECT_EQ(profile_of(parse_config(own, "b.toml", folder.path()))[1].y, 3.0);
}

// Catches: a wrong value taken for a curve, or reported without its place.
TEST(ConfigCurves, WrongPointsAreReportedWithTheirLine) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"3", ":16: axis.mechanics.load_profile must be points [[x, y], ...] or the name of a CSV file"},
      {"true", ":16: axis.mechanics.load_profile must be points"},
      {"{ x = 1 }", ":16: axis.mechanics.load_profile must be points"},
      {"[]", ":16: axis.mechanics.load_profile "},
      {"[[0, 1]]", ":16: axis.mechanics.load_profile "},
      {"[0, 1]", ":16: axis.mechanics.load_profile point 1 must be two finite numbers: [x, y]"},
      {"[[0, 1],\n[1, 2, 3]]", ":17: axis.mechanics.load_profile point 2 must be two"},
      {"[[0, 1],\n[1, \"2\"]]", ":17: axis.mechanics.load_profile point 2 must be two"},
      {"[[0, 1],\n[1, nan]]", ":17: axis.mechanics.load_profile point 2 must be two"},
      {"[[0, 1],\n[inf, 1]]", ":17: axis.mechanics.load_profile point 2 must be two"},
      {"[[0, 1], [0, 2]]", ":16: axis.mechanics.load_profile "},
      {"[[1, 1], [0, 2]]", ":16: axis.mechanics.load_profile "},
      {"\"no.csv\"", ":16: axis.mechanics.load_profile names /nonexistent/no.csv, which cannot be read"},
      {"\"/dev/zero\"", ":16: axis.mechanics.load_profile names /dev/zero, which is not a regular file"},
      {"\"\"", ":16: axis.mechanics.load_profile is \"\" but must be text of 1 to 800"},
  };
  for (const auto& [value, said] : cases) {
    const std::string found = problems_of(with_profile(value));
    EXPECT_NE(found.find("b.toml" + said), std::string::npos) << value << "\n  gave: " << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << value << "\n  gave more than one: " << found;
  }
  EXPECT_NE(problems_of(with_profile("\"p.csv\""), {}).find("must stand for itself"), std::string::npos);
}

// Catches: a reader that crashes, hangs, reads on or fills the terminal with a file that is no table.
TEST(ConfigCurves, HostileFilesAreReportedWithTheirLine) {
  const Folder folder;
  const std::string file = (folder.path() / "p.csv").string();
  const auto told = [&](const std::string& text) {
    folder.write("p.csv", text);
    const std::string found = problems_of(with_profile("\"p.csv\""), folder.path());
    EXPECT_LT(found.size(), 400u) << found;
    EXPECT_EQ(found.find('\n'), std::string::npos) << found;
    return found.substr(0, file.size()) == file ? found.substr(file.size()) : found;
  };
  EXPECT_EQ(told(""), ": has 0 points but a curve needs two");
  EXPECT_EQ(told("x,y\n"), ": has 0 points but a curve needs two");
  EXPECT_EQ(told("0,1\n"), ": has 1 points but a curve needs two");
  EXPECT_EQ(told("0,1\nx,y\n"), ":2: is \"x,y\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n1;2\n"), ":2: is \"1;2\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0 1\n1 2\n"), ":1: is \"0 1\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n1,2,3\n"), ":2: is \"1,2,3\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("O,1\n1,2\n"), ":1: is \"O,1\" but must be two finite numbers, x,y") << "no header";
  EXPECT_EQ(told("0,1\n1,nan\n"), ":2: is \"1,nan\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n1,inf\n"), ":2: is \"1,inf\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n1,1e999\n"), ":2: is \"1,1e999\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n0x1,2\n"), ":2: is \"0x1,2\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n,\n"), ":2: is \",\" but must be two finite numbers, x,y");
  EXPECT_EQ(told("0,1\n\n\n0,2\n"), ":4: x is 0 but must be greater than the x before it, 0");
  EXPECT_EQ(told("0,1\n2,2\n1,3\n"), ":3: x is 1 but must be greater than the x before it, 2");
  EXPECT_NE(told(std::string(100'000, '\0')).find(":1: is \"???"), std::string::npos);
  EXPECT_NE(told("0,1\n" + std::string(1'000'000, '7')).find(":2: is \"777"), std::string::npos);
  EXPECT_EQ(told("0,1\n\x1b[31m,2\n"), ":2: is \"?[31m,2\" but must be two finite numbers, x,y");
  EXPECT_NE(told(std::string(9'000'000, '\n')).find("is larger than 8388608 bytes"), std::string::npos);
}

// Catches: a curve without bound, and a bound below the longest recorded curve.
TEST(ConfigCurves, AHundredThousandPointsFitAndReadBack) {
  const Folder folder;
  const auto points = [](std::size_t count) {
    std::string text;
    for (std::size_t i = 0; i < count; ++i)
      text += shortest(-1.0 / 3.0 + 1e-7 * static_cast<double>(i)) + "," +
              shortest(-1.0 / (1.0 + static_cast<double>(i))) + "\n";
    return text;
  };
  folder.write("p.csv", points(kMaxCurvePoints));
  const BenchConfig config = parse_config(with_profile("\"p.csv\""), "b.toml", folder.path());
  ASSERT_EQ(profile_of(config).size(), kMaxCurvePoints);
  const std::string text = to_toml(config);
  EXPECT_LT(text.size(), kMaxRecordedConfigBytes);
  expect_equal(profile_of(parse_config(text, "bench.toml", {})), profile_of(config));

  folder.write("p.csv", points(kMaxCurvePoints + 1));
  EXPECT_NE(problems_of(with_profile("\"p.csv\""), folder.path())
                .find(":100001: is one more than the 100000 points that there may be"),
            std::string::npos);
  folder.write("p.csv", points(50'001));
  const std::string second = "[[axis]]\nname = \"y\"\n" + kBench.substr(kBench.find("[axis.machine]"));
  const std::string both =
      with_profile("\"p.csv\"") +
      std::string(second).replace(second.find("inertia"), 0, "load_profile = \"p.csv\"\n");
  const std::string found = problems_of(both, folder.path());
  EXPECT_NE(
      found.find("axis.name has curves that bring the points of all axes to 100002 but there may be 100000"),
      std::string::npos)
      << found;
}

}  // namespace
}  // namespace drivebench::test::curves_test
