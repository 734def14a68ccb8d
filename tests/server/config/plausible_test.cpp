// Values that keep the rules and are probably mistakes.
#include "server/config/sections/plausible.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "server/config/sections/parameters.hpp"
#include "server/config/words.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::plausible_test {
namespace {

std::string oddities_of(const fs::path& file) {
  try {
    std::vector<ConfigProblem> odd;
    load_config(file, odd);
    if (!odd.empty()) throw ConfigError(std::move(odd));
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "none";
}

bool says(const std::vector<Problem>& odd, std::string_view field) {
  return std::any_of(odd.begin(), odd.end(), [field](const Problem& each) { return each.field == field; });
}

// Catches: millihenries, milliohms or gram square centimetres that are taken for SI units; a message without
// the place, the value, the window or the remedy; a window with its edge on the wrong side.
TEST(ConfigPlausible, CFG_02_AWrongUnitIsReportedWithItsWindow) {
  struct Case {
    std::string from, to, said;
  };
  const Folder folder;
  for (const Case& c : std::vector<Case>{
           {"0.014\nrotor", "14.0\nrotor",
            ":11: axis.machine.stator_inductance_h is 14 H, which is odd: a machine of kind \"induction\" "
            "has 1e-04 to 3 H; --allow-odd takes it all the same"},
           // The step is too long for such a machine; the wrong unit explains it.
           {"stator_resistance_ohm = 1.7", "stator_resistance_ohm = 1700.0",
            ":9: axis.machine.stator_resistance_ohm is 1700 ohm, which is odd: "},
           {"pole_pairs = 3", "pole_pairs = 60", ":8: axis.machine.pole_pairs is 60, which is odd: "},
           {"1.1e-4", "1.1e-10",
            ":15: axis.mechanics.inertia_kgm2 is 1.1e-10 kg*m^2, which is odd: an axis has "},
           {"= 80", "= 8e5", ":17: axis.amplifier.voltage_limit_v is 8e+05 V, which is odd: "},
           {"= 80", "= 1e5", ""},
           {"stator_resistance_ohm = 1.7", "stator_resistance_ohm = 1e-4", ""},
           {"stator_resistance_ohm = 1.7", "stator_resistance_ohm = 0.9e-4", ":9: axis.machine.stator"},
       }) {
    const std::string found = oddities_of(folder.write("b.toml", with(c.from, c.to)));
    if (c.said.empty()) {
      EXPECT_EQ(found, "none") << c.to;
    } else {
      EXPECT_NE(found.find("b.toml" + c.said), std::string::npos) << c.to << "\n  gave: " << found;
    }
  }
  EXPECT_EQ(problems_of(with("pole_pairs = 3", "pole_pairs = 60")), "none") << "a recording of it replays";
}

// Catches: a leakage that was lost with the last digit, which makes the machine nothing but stiff.
TEST(ConfigPlausible, CFG_03_AVerySmallLeakageIsOdd) {
  const Folder folder;
  for (const double sigma : {0.0049, 0.0051}) {
    const double mutual_h = 0.014 * std::sqrt(1.0 - sigma);
    const std::string found = oddities_of(folder.write("b.toml", with("0.0117", real_text(mutual_h))));
    if (sigma > 0.005) {
      EXPECT_EQ(found, "none");
    } else {
      EXPECT_NE(found.find(":13: axis.machine.mutual_inductance_h makes the leakage factor sigma = 0.0049"),
                std::string::npos)
          << found;
    }
  }
}

// Catches: a window that a machine of the book does not fit through; a kind of machine, or a number that
// every machine of a kind must name, without a window.
TEST(ConfigPlausible, CFG_02_EveryBenchFitsAndAMillionTimesItsValuesDoNot) {
  std::set<std::string_view> kinds;
  for (const auto& entry : fs::directory_iterator(kConfigs / "benches")) {
    EXPECT_EQ(oddities_of(entry.path()), "none") << entry.path();
    for (const AxisSetup& axis : load_config(entry.path()).setup.axes) {
      kinds.insert(machine_kind(axis.parameters));
      for (const Parameter& row : axis_parameters(axis.parameters)) {
        if (section_of(row.name) != "machine" || !row.required || row.integer) continue;
        if (row.get(axis.parameters) == 0.0) continue;
        AxisParameters p = axis.parameters;
        row.set(p, 1e6 * row.get(p));
        EXPECT_TRUE(says(oddities(p), row.name)) << row.name << " of " << entry.path();
      }
    }
  }
  EXPECT_GE(kinds.size(), 9u);
}

}  // namespace
}  // namespace drivebench::test::plausible_test
