// Experiments as TOML files, and the rows that come back.
#include "clients/command/experiment/experiment_file.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <bit>
#include <filesystem>
#include <fstream>

#include "clients/command/experiment/experiment_data.hpp"
#include "protocols/document.hpp"

namespace drivebench::command::experiment_file_test {
namespace {

const std::string kGood =
    "label = \"two sines\"\n"                          // 1
    "axis = \"dc-a\"\n"                                // 2
    "duration_s = 1\n"                                 // 3
    "decimation = 2\n"                                 // 4
    "signals = [\"i_a_a\", \"encoder_count\"]\n"       // 5
    "stop = { current_a = 6.0 }\n"                     // 6
    "[input]\n"                                        // 7
    "kind = \"phase_currents\"\n"                      // 8
    "[[input.shapes]]\n"                               // 9
    "channel = \"a\"\n"                                // 10
    "end_s = 0.5\n"                                    // 11
    "sine = { amplitude = 2.5, frequency_hz = 10 }\n"  // 12
    "[[events]]\n"                                     // 13
    "at_s = 0.2\n"                                     // 14
    "fault = { name = \"open_phase\", value = 1 }\n";  // 15

/// The problems of a text, as a user reads them.
std::string problems_of(const std::string& text) {
  try {
    parse_experiment(text, "e.toml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "none";
}

// Catches: a key that is read into another field, a whole number that a real one does not take, a lost
// default.
TEST(ExperimentFile, GivesTheRequestWithItsValues) {
  const ExperimentFile file = parse_experiment(kGood, "e.toml");
  EXPECT_EQ(file.axis, "dc-a");
  const v1::RunExperiment& r = file.request;
  EXPECT_EQ(r.label(), "two sines");
  EXPECT_EQ(r.mode(), v1::MODE_FREE);
  EXPECT_EQ(r.duration_s(), 1.0);
  EXPECT_EQ(r.decimation(), 2u);
  ASSERT_EQ(r.signals_size(), 2);
  EXPECT_EQ(r.stop().current_a(), 6.0);
  EXPECT_EQ(r.input().kind(), v1::INPUT_KIND_PHASE_CURRENTS);
  ASSERT_EQ(r.input().shapes_size(), 1);
  EXPECT_EQ(r.input().shapes(0).channel(), v1::CHANNEL_A);
  EXPECT_EQ(r.input().shapes(0).sine().frequency_hz(), 10.0);
  ASSERT_EQ(r.events_size(), 1);
  EXPECT_EQ(r.events(0).fault().name(), "open_phase");
}

// Catches: a value that a suggested experiment loses on its way through its file: a zero, a table in an
// array, text with quotes.
TEST(ExperimentFile, OfEveryShippedExperimentIsWrittenAsItIsRead) {
  int files = 0;
  const auto expect_same = [&](const ExperimentFile& file) {
    const ExperimentFile again = parse_experiment(to_toml(file, "one line\nanother"), "again.toml");
    EXPECT_EQ(again.axis, file.axis);
    EXPECT_EQ(again.request.SerializeAsString(), file.request.SerializeAsString()) << to_toml(file, "");
    ++files;
  };
  for (const auto& entry : std::filesystem::directory_iterator(DRIVEBENCH_CONFIGS "/experiments"))
    expect_same(load_experiment(entry.path()));
  expect_same(parse_experiment(kGood, "e.toml"));
  expect_same(
      parse_experiment("axis = 'a \"b\" \\ c'\nlabel = 'd \"e\" \\ f'\n"
                       "settings = [{ name = \"amplifier.delay_ticks\", value = 0 }]\n",
                       "e.toml"));
  EXPECT_GT(files, 8);
}

// Catches: a mistake that is passed over, told with another line, or the only one that is told.
TEST(ExperimentFile, ReportsEveryProblemWithItsLine) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = kGood;
    return problems_of(text.replace(text.find(from), from.size(), to));
  };
  EXPECT_TRUE(with("duration_s = 1", "duraton_s = 1")
                  .starts_with("e.toml:3: duraton_s is not known here; there are"));
  EXPECT_EQ(with("decimation = 2", "decimation = -1"),
            "e.toml:4: decimation must be a whole number from 0 to 4294967295");
  EXPECT_EQ(with("= 0.5", "= nan"), "e.toml:11: input.shapes[0].end_s must be a finite number");
  EXPECT_EQ(with("\"a\"", "\"x\""), "e.toml:10: input.shapes[0].channel must be one of a, b, c, f, d, q");
  EXPECT_EQ(with("value = 1 }", "value = 1 }\nload_nm = 0.1"),
            "e.toml:16: events[0].load_nm is one too many beside fault");
  EXPECT_EQ(with("[\"i_a_a\", \"encoder_count\"]", "\"i_a_a\""), "e.toml:5: signals must be an array");
  EXPECT_EQ(with("\"two sines\"", "7"),
            "e.toml:1: label must be text of at most 160 bytes without control characters");
  EXPECT_EQ(with("{ current_a = 6.0 }", "3"), "e.toml:6: stop must be a table");
  const std::string two = problems_of("ticks = \"many\"\nowner = \"me\"\n");
  EXPECT_TRUE(two.starts_with("e.toml:1: ticks must be a whole number")) << two;
  EXPECT_NE(two.find("\ne.toml:2: owner is not known here"), std::string::npos) << two;
}

// Catches: a text that brings the reader down instead of being refused.
TEST(ExperimentFile, HostileTextIsRefused) {
  for (const std::string& text :
       {std::string("[[[a]]]"), std::string(300'000, 'a'), std::string("a = ") + std::string(5000, '['),
        std::string("input = 1979-05-27"), std::string("signals = [[[[1]]]]"), std::string("\0x = 1", 6),
        std::string("[input]\nshapes = [ {channel = {}} ]"), std::string("axis = 1.5")}) {
    EXPECT_NE(problems_of(text), "none") << text.substr(0, 40);
  }
}

class Csv : public testing::Test {
 protected:
  Csv() {
    std::string name = (std::filesystem::temp_directory_path() / "drivebench-csv-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~Csv() override { std::filesystem::remove_all(folder_); }

  /// The numbers of rows and uploads that came; or the problem.
  std::string read(const std::string& text) {
    std::ofstream(folder_ / "t.csv", std::ios::binary) << text;
    int uploads = 0;
    double last = 0.0;
    int rows = 0;
    try {
      read_table(folder_ / "t.csv", [&](v1::UploadTable& upload) {
        ++uploads;
        rows += upload.times_s_size();
        last = upload.values(upload.values_size() - 1);
      });
    } catch (const ConfigError& error) {
      return error.problems().front().rule + " in " + std::to_string(error.problems().front().line);
    }
    return fmt::format("{} rows in {}, last {}", rows, uploads, last);
  }
  std::filesystem::path folder_;
};

// Catches: a header that is taken for a row, a last upload that is forgotten, garbage that counts as zero.
TEST_F(Csv, TablesAreReadRowByRow) {
  EXPECT_EQ(read("time_s,u_v\n0, 1.5\r\n0.1,-2e1\n"), "2 rows in 1, last -20");
  EXPECT_EQ(read("0,1\n1,x\n"), "must be a time in s, a comma and a value in 2");
  EXPECT_EQ(read("0,1\n1,2,3\n"), "must be a time in s, a comma and a value in 2");
  EXPECT_EQ(read("0,1\n1,nan\n"), "must be a time in s, a comma and a value in 2");
  EXPECT_EQ(read("0,1\n" + std::string(300, '1') + "\n"), "is longer than 200 bytes in 2");
  std::string many;
  for (int i = 0; i < 4001; ++i)
    many += fmt::format("{},{}\n", i, i);
  EXPECT_EQ(read(many), "4001 rows in 2, last 4000");
}

v1::ExperimentData rows_of(std::uint64_t first_tick, const std::vector<double>& values) {
  v1::ExperimentData data;
  data.set_first(first_tick);
  for (const double value : values) {
    const auto word = std::bit_cast<std::uint64_t>(value);
    for (int i = 0; i < 8; ++i)
      data.mutable_data()->push_back(static_cast<char>(word >> (8 * i)));
  }
  return data;
}

// Catches: rows that a second connection brings again and that are written twice, a hole that is not noticed.
TEST_F(Csv, RepeatedRowsAreWrittenOnce) {
  v1::ExperimentInfo info;
  info.add_signals("i_a_a");
  info.add_signals("encoder_count");
  info.set_decimation(2);
  info.set_period_s(1e-3);
  const std::string file = (folder_ / "out.csv").string();
  {
    DataWriter out(file, false);
    out.describe(info);
    out.take(rows_of(0, {0.5, 1.0, 0.25, 2.0}));
    EXPECT_EQ(out.next_tick(), 4u);
    out.describe(info);
    out.take(rows_of(2, {0.25, 2.0, 0.125, 3.0}));
    out.take(rows_of(2, {0.25, 2.0}));
    EXPECT_THROW(out.take(rows_of(8, {0.0, 0.0})), std::runtime_error);
    EXPECT_THROW(out.take(rows_of(6, {0.0})), std::runtime_error);
    out.flush();
    EXPECT_EQ(out.rows(), 3u);
  }
  std::ifstream in(file);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(text,
            "tick,time_s,i_a_a [A],encoder_count [counts]\n0,0.000000000,0.5,1\n2,0.002000000,0.25,2\n"
            "4,0.004000000,0.125,3\n");
}

}  // namespace
}  // namespace drivebench::command::experiment_file_test
