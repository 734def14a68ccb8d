#include "clients/command/identify/data/identify_map.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/identify/identify.hpp"
#include "protocols/document.hpp"

namespace drivebench::command::identify_map_test {
namespace {

using identification::ColumnMap;
using identification::CsvOptions;

// Catches: a header cut at its own sign, an exponent taken for an offset, a sign that is lost.
TEST(IdentifyMap, AColumnHasHeaderSignalFactorAndOffset) {
  ColumnMap column = parse_column("I_A=i_a_a");
  EXPECT_EQ(column.header, "I_A");
  EXPECT_EQ(column.name, "i_a_a");
  EXPECT_EQ(column.factor, 1.0);
  EXPECT_EQ(column.offset, 0.0);
  column = parse_column("a=b [mV]=u_b_v*1e-3");
  EXPECT_EQ(column.header, "a=b [mV]");
  EXPECT_EQ(column.name, "u_b_v");
  EXPECT_EQ(column.factor, 1e-3);
  column = parse_column("raw=i_c_a*-2.5e+1-0.125");
  EXPECT_EQ(column.factor, -25.0);
  EXPECT_EQ(column.offset, -0.125);
  EXPECT_EQ(parse_column("raw=i_c_a*2+1").offset, 1.0);
}

std::string refusal_of(const std::string& text) {
  try {
    parse_column(text);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "none";
}

// Catches: a wrong column that is read as something else, and a refusal that does not tell the rule.
TEST(IdentifyMap, AWrongColumnIsRefusedWithTheRule) {
  EXPECT_NE(refusal_of("I_A").find("should be HEADER=SIGNAL"), std::string::npos);
  EXPECT_NE(refusal_of("=i_a_a").find("HEADER=SIGNAL"), std::string::npos);
  EXPECT_NE(refusal_of("I_A=").find("HEADER=SIGNAL"), std::string::npos);
  EXPECT_NE(refusal_of("I_A=current").find("there are i_a_a, i_b_a"), std::string::npos);
  for (const char* wrong :
       {"I=i_a_a*", "I=i_a_a*0", "I=i_a_a*nan", "I=i_a_a*1e999", "I=i_a_a*2+", "I=i_a_a*2+x"})
    EXPECT_NE(refusal_of(wrong).find("a factor other than 0"), std::string::npos)
        << wrong << ": " << refusal_of(wrong);
  EXPECT_EQ(refusal_of(std::string("I\x1b[2J=x")).find('\x1b'), std::string::npos);
}

// Catches: a key of the file that does nothing.
TEST(IdentifyMap, AFileMapsColumnsAndTime) {
  const CsvOptions csv = parse_column_map(R"(
time = "t [ms]"
time_factor = 1e-3
[columns]
u_a_v = "Ua"
i_a_a = { header = "Ia", factor = 0.001, offset = -2 }
angle_rad = { factor = 0.017453292519943295 }
)",
                                          "map.toml");
  EXPECT_EQ(csv.time, "t [ms]");
  EXPECT_EQ(csv.time_factor, 1e-3);
  ASSERT_EQ(csv.columns.size(), 3U);
  for (const ColumnMap& column : csv.columns) {
    if (column.name == "u_a_v") {
      EXPECT_EQ(column.header, "Ua");
    } else if (column.name == "i_a_a") {
      EXPECT_EQ(column.header, "Ia");
      EXPECT_EQ(column.factor, 1e-3);
      EXPECT_EQ(column.offset, -2.0);
    } else {
      EXPECT_EQ(column.name, "angle_rad");
      EXPECT_TRUE(column.header.empty());  // the header is the name
    }
  }
  EXPECT_EQ(parse_column_map("period_s = 1e-4\n[columns]\ni_a_a = \"x\"\n", "m").period_s, 1e-4);
}

// Catches: a column-map file whose mistakes are passed over, or told one at a time.
TEST(IdentifyMap, AllProblemsOfAFileAreReportedAtOnce) {
  try {
    parse_column_map(
        "tiem = \"t\"\nperiod_s = 0.0\ntime_factor = \"x\"\n[columns]\nspeed = \"n\"\ni_a_a = 3\n"
        "u_a_v = { header = \"U\", gain = 2.0 }\ni_b_a = { factor = 0.0 }\n",
        "map.toml");
    FAIL() << "taken";
  } catch (const ConfigError& error) {
    const std::string text = error.what();
    for (const char* part :
         {"map.toml:1: tiem is not known here", "map.toml:2: period_s must be above 0",
          "map.toml:3: time_factor must be a finite number", "map.toml:5: columns.speed is no signal",
          "map.toml:6: columns.i_a_a must be text", "map.toml:7: columns.u_a_v.gain is not known",
          "map.toml:8: columns.i_b_a.factor must not be 0"})
      EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
  }
}

// Catches: a command line that does not go before the file.
TEST(IdentifyMap, TheCommandLineOverridesTheFile) {
  IdentifyOptions options;
  options.maps = {"I=i_a_a", "U=u_a_v*2"};
  options.time = "zeit";
  options.period_s = 1e-3;
  const CsvOptions csv = csv_options(options);
  ASSERT_EQ(csv.columns.size(), 2U);
  EXPECT_EQ(csv.columns[1].factor, 2.0);
  EXPECT_EQ(csv.time, "zeit");
  EXPECT_EQ(csv.period_s, 1e-3);
  options.maps = {"nowhere.toml"};
  EXPECT_THROW(csv_options(options), UsageError);
}

}  // namespace
}  // namespace drivebench::command::identify_map_test
