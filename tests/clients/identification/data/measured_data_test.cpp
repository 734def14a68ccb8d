#include "clients/identification/data/measured_data.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>

namespace drivebench::identification::measured_data_test {
namespace {

std::string refusal(std::string_view text, const CsvOptions& options = {}) {
  try {
    (void)parse_csv(text, "x.csv", options);
  } catch (const IdentificationError& error) {
    return error.what();
  }
  return "";
}

// The text is as `drivebench export` writes it. Catches: units left in names, a period from two rows instead
// of all.
TEST(MeasuredData, AnExportReadsBack) {
  const MeasuredData data = parse_csv(
      "tick,time_s,i_a_a [A],encoder_count "
      "[counts]\n8,0.001000000,1.5,-3\n9,0.001125000,-2e-3,4\n10,0.00125,0.25,5\n",
      "x.csv");
  EXPECT_NEAR(data.period_s, 125e-6, 1e-15);
  EXPECT_EQ(data.samples(), 3U);
  EXPECT_EQ(data.find("i_a_a")->unit, "A");
  EXPECT_EQ(Series(data.at("i_a_a").begin(), data.at("i_a_a").end()), (Series{1.5, -2e-3, 0.25}));
  EXPECT_EQ(data.at("encoder_count")[0], -3.0);
  EXPECT_EQ(data.find("u_a_v"), nullptr);
  EXPECT_THROW((void)data.at("u_a_v"), IdentificationError);
}

// A foreign scope: semicolons, quotes, CRLF, a byte order mark, other names, milliampere, an offset. Catches:
// a factor that is divided by, an offset before the factor.
TEST(MeasuredData, AColumnMapReadsFilesOfOtherPrograms) {
  const MeasuredData data =
      parse_csv("\xEF\xBB\xBF\"CH1 [mV]\"; CH2 ;note\r\n 100;+1;3\r\n200;2;4\r\n\r\n", "x.csv",
                {.columns = {{"i_a_a", "CH1", 0.01, -1.0}, {"u_a_v", "CH2", 1.0, 0.0}}, .period_s = 1e-3});
  EXPECT_EQ(data.columns.size(), 2U);
  EXPECT_DOUBLE_EQ(data.at("i_a_a")[1], 1.0);
  EXPECT_DOUBLE_EQ(data.at("u_a_v")[0], 1.0);
  EXPECT_EQ(data.period_s, 1e-3);
}

// Each refusal names line, column and rule. Catches: a broken file that is read as a short one or as zeros.
TEST(MeasuredData, HostileFilesAreRefusedWithLineColumnAndRule) {
  const CsvOptions fast{.period_s = 1e-3};
  EXPECT_EQ(refusal(""), "x.csv:1: the first line must name the columns; it is empty");
  EXPECT_EQ(refusal("a,b\n1,2\n3\n", fast), "x.csv:3: 1 values where the first line names 2 columns");
  EXPECT_EQ(refusal("a,b\n1,2\n3,x\n", fast),
            "x.csv:3: b: 'x' is not a number (decimal point, no thousands separator)");
  EXPECT_EQ(refusal("a,b\n1,2\n3,\n", fast),
            "x.csv:3: b: empty; every row needs a number in every column that is used");
  EXPECT_EQ(refusal("a\n1\nnan\n", fast), "x.csv:3: a: 'nan' is not finite");
  EXPECT_EQ(refusal("a\n1\n1e999\n", fast), "x.csv:3: a: '1e999' is beyond what a double holds");
  EXPECT_EQ(refusal("a\n1\n0x10\n", fast),
            "x.csv:3: a: '0x10' is not a number (decimal point, no thousands separator)");
  EXPECT_EQ(refusal("a;b\n1;2,5\n", fast),
            "x.csv:2: b: '2,5' is not a number (decimal point, no thousands separator)");
  EXPECT_EQ(
      refusal("1,2\n3,4\n", fast),
      "x.csv:1: 1: a number where the name of a column is expected; the first line must name the columns");
  EXPECT_EQ(refusal("a,a\n1,2\n", fast), "x.csv:1: a: two columns have this name");
  EXPECT_EQ(refusal("a,\n1,2\n", fast),
            "x.csv:1: column 2 has no name; the first line must name the columns");
  EXPECT_EQ(refusal("a\n1\n\n2\n", fast), "x.csv:3: an empty line in the middle of the data");
  EXPECT_EQ(refusal("a\n", fast), "x.csv:1: no rows");
  EXPECT_EQ(refusal("a\n1\n"), "x.csv:1: time_s: no such column; there are a");
  EXPECT_EQ(refusal("time_s\n0\n1\n1\n"), "x.csv:4: time_s: time does not rise");
  EXPECT_EQ(refusal("time_s\n0\n1\n2\n4\n").substr(0, 29), "x.csv:3: time_s: a step of 1 ");
  EXPECT_EQ(refusal("a\n1\n", {.columns = {{"i", "b", 1.0, 0.0}}, .period_s = 1.0}),
            "x.csv:1: b: no such column; there are a");
  EXPECT_EQ(refusal("a\n1\n", {.columns = {{"i", "a", 0.0, 0.0}}, .period_s = 1.0}),
            "x.csv:1: i: factor and offset of a column must be finite, the factor not 0");
  EXPECT_NE(refusal("a\n1\n", {.period_s = -1.0}), "");
  EXPECT_NE(refusal("a\n1\n", {.period_s = std::numeric_limits<double>::infinity()}), "");
  EXPECT_NE(refusal(std::string("a\n\x01\x00\x7f\n", 6), fast).find("' is not a number"), std::string::npos);
  EXPECT_NE(refusal("a\n" + std::string(100'000, '9') + "x\n", fast).find("..."), std::string::npos);
  EXPECT_THROW((void)read_csv("/nowhere/x.csv"), IdentificationError);
}

// 20 000 files of random pieces: each is read or refused, nothing else happens. Catches: an index beyond a
// line.
TEST(MeasuredData, RandomFilesAreReadOrRefused) {
  std::mt19937 engine(9);
  const std::string_view pieces[] = {"a", ",", ";",      "\n",     "\r\n", "\"",           "[",   "]",
                                     " ", "1", "-2.5e3", "time_s", "nan",  "\xEF\xBB\xBF", "\0x", "9e99999"};
  for (int file = 0; file < 20'000; ++file) {
    std::string text;
    for (std::size_t k = engine() % 24; k > 0; --k)
      text += pieces[engine() % std::size(pieces)];
    const std::string why = refusal(text, {.period_s = file % 2 == 0 ? 0.0 : 1.0});
    ASSERT_TRUE(why.empty() || why.starts_with("x.csv:")) << text;
  }
}

}  // namespace
}  // namespace drivebench::identification::measured_data_test
