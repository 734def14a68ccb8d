#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>

#include "clients/regression/results/fingerprints.hpp"
#include "clients/regression/results/results_folder.hpp"
#include "clients/regression/results/shard.hpp"
#include "tests/clients/regression/report_text.hpp"

namespace drivebench::regression::results_test {
namespace {

namespace fs = std::filesystem;

std::string problem_of(const std::string& text, const std::map<std::string, std::string>& variables) {
  try {
    const Shard shard = shard_of(text, [&variables](const char* name) {
      const auto found = variables.find(name);
      return found == variables.end() ? nullptr : found->second.c_str();
    });
    return std::to_string(shard.index) + " of " + std::to_string(shard.count);
  } catch (const std::invalid_argument& problem) {
    return problem.what();
  }
}

// Catches: a place that no shard has, or two have.
TEST(Shard, EveryPlaceIsInOneOfThem) {
  for (std::size_t place = 0; place < 20; ++place) {
    int shards = 0;
    for (std::size_t index = 1; index <= 7; ++index)
      shards += Shard{.index = index, .count = 7}.has(place) ? 1 : 0;
    EXPECT_EQ(shards, 1) << place;
  }
}

// Catches: a run that takes the index of Kubernetes, which begins at 0, for one that begins at 1; an array of
// Slurm that lacks a task, so that no task runs the cases of that shard.
TEST(Shard, IsGivenOrReadFromTheEnvironment) {
  EXPECT_EQ(problem_of("2/4", {}), "2 of 4");
  EXPECT_EQ(problem_of("auto", {{"CI_NODE_INDEX", "1"}, {"CI_NODE_TOTAL", "3"}}), "1 of 3");
  EXPECT_EQ(problem_of("auto", {{"JOB_COMPLETION_INDEX", "0"}, {"DRIVEBENCH_SHARDS", "3"}}), "1 of 3");
  std::map<std::string, std::string> slurm = {{"SLURM_ARRAY_TASK_ID", "7"},
                                              {"SLURM_ARRAY_TASK_MIN", "5"},
                                              {"SLURM_ARRAY_TASK_MAX", "8"},
                                              {"SLURM_ARRAY_TASK_COUNT", "4"}};
  EXPECT_EQ(problem_of("auto", slurm), "3 of 4");
  slurm["SLURM_ARRAY_TASK_COUNT"] = "3";
  EXPECT_NE(problem_of("auto", slurm).find("only one without gaps"), std::string::npos);
  slurm.erase("SLURM_ARRAY_TASK_MAX");
  EXPECT_EQ(problem_of("auto", slurm), "the variable SLURM_ARRAY_TASK_MAX is missing");
}

// Catches: a mistake in a script of a cluster that runs no case, or all of them in each task.
TEST(Shard, MistakesAreTold) {
  EXPECT_NE(problem_of("auto", {}).find("has none of SLURM_ARRAY_TASK_ID, CI_NODE_INDEX"), std::string::npos);
  EXPECT_EQ(problem_of("3", {}), "is '3' but must be 'auto' or I/N, for example 2/4");
  EXPECT_EQ(problem_of("1/4x", {}), "is '1/4x' but must be 'auto' or I/N, for example 2/4");
  EXPECT_NE(problem_of("0/4", {}).find("shard 0 of 4 must be one from 1"), std::string::npos);
  EXPECT_NE(problem_of("5/4", {}).find("shard 5 of 4"), std::string::npos);
  EXPECT_NE(problem_of("1/0", {}).find("shard 1 of 0"), std::string::npos);
  EXPECT_NE(problem_of("-1/4", {}).find("must be 'auto'"), std::string::npos);
  EXPECT_EQ(problem_of("auto", {{"CI_NODE_INDEX", "one"}, {"CI_NODE_TOTAL", "3"}}),
            "CI_NODE_INDEX is 'one' but must be a whole number");
}

/// A folder for the files of a test, removed at the end.
class Results : public testing::Test {
 protected:
  ~Results() override { fs::remove_all(folder_); }

  std::string content_of(const fs::path& file) const {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  fs::path folder_ = fs::temp_directory_path() / ("drivebench-results-" + std::to_string(::getpid()));
};

CaseResult a_result() {
  CaseResult result{.name = "a[x=1]", .file = "a.toml", .line = 7, .values = {{"x", "1"}}, .tags = {"t"}};
  result.verdict = Verdict::kFail;
  result.findings.push_back({.name = "speed",
                             .kind = "bounds",
                             .signal = "speed_rad_s",
                             .axis = "one",
                             .unit = "rad/s",
                             .applied = true,
                             .measured = 0.1,
                             .limit = std::numeric_limits<double>::infinity(),
                             .from_s = 1.0 / 3.0,
                             .to_s = 1.0,
                             .sentence = "too fast",
                             .line = 9});
  result.bench_s = 0.2;
  result.samples = 12;
  result.hash = 0xfedcba9876543210;
  result.output = "said\n\xff";
  result.plots = {"<svg/>"};
  return result;
}

// Catches: a report that differs when its results came from files.
TEST_F(Results, AreReadAsTheyWereWritten) {
  const ResultsFolder folder(folder_);
  CaseResult result = a_result();
  result.output = "said\n";
  folder.put(result, "f1");
  const auto read = folder.find("a[x=1]", "f1");
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(text_of(json_report, {*read}), text_of(json_report, {result}));
  EXPECT_EQ(text_of(junit_report, {*read}), text_of(junit_report, {result}));
  EXPECT_EQ(text_of(github_report, {*read}), text_of(github_report, {result}));
  EXPECT_EQ(read->plots, result.plots);
}

// Catches: a result of another state of the case, or a file that was cut short, taken for a result; a file
// that stays half written beside them.
TEST_F(Results, AnythingElseIsNoResult) {
  const ResultsFolder folder(folder_);
  folder.put(a_result(), "f1");
  EXPECT_FALSE(folder.find("a[x=1]", "f2").has_value());
  EXPECT_FALSE(folder.find("a[x=2]", "f1").has_value());
  ASSERT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
  const fs::path file = fs::directory_iterator(folder_)->path();
  const std::string whole = content_of(file);
  for (std::size_t length = 0; length < whole.size() - 1; ++length) {
    std::ofstream(file, std::ios::binary) << whole.substr(0, length);
    EXPECT_FALSE(folder.find("a[x=1]", "f1").has_value()) << length;
  }
  for (const std::string_view word : {"\"fail\"", "\"fedcba9876543210\"", "\"a.toml\"", "0.1"}) {
    std::string wrong = whole;
    wrong.replace(wrong.find(word), word.size(), "[]");
    std::ofstream(file, std::ios::binary) << wrong;
    EXPECT_FALSE(folder.find("a[x=1]", "f1").has_value()) << word;
  }
  std::ofstream(file, std::ios::binary) << whole;
  EXPECT_TRUE(folder.find("a[x=1]", "f1").has_value());
}

// Catches: a result of a controller, a bench or a case as it was before the last change.
TEST_F(Results, AFingerprintKnowsWhatARunDependsOn) {
  fs::create_directories(folder_);
  const auto write = [this](const char* name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
  };
  const fs::path bench = folder_ / "bench.toml";
  const fs::path motor = folder_ / "motor.toml";
  fs::copy_file(DRIVEBENCH_CONFIGS "/motors/servo-im.toml", motor);
  std::string text = content_of(DRIVEBENCH_CONFIGS "/benches/servo.toml");
  text.replace(text.find("../motors/servo-im.toml"), 23, "motor.toml");
  write("bench.toml", text);
  write("case.toml", "one");
  write("device.py", "one");
  Case c{.name = "case", .file = (folder_ / "case.toml").string(), .bench = "bench.toml"};
  c.device.command = {"python3", "device.py"};
  const auto print = [&](const char* program = "p") { return Fingerprints(program).of(c, bench); };
  const std::string first = print();
  EXPECT_EQ(print(), first);
  EXPECT_NE(print("q"), first);
  c.name = "other";
  EXPECT_NE(print(), first);
  c.name = "case";
  for (const char* const name : {"case.toml", "device.py"}) {
    write(name, "two");
    EXPECT_NE(print(), first) << name;
    write(name, "one");
  }
  std::ofstream(motor, std::ios::app) << "\n[thermal]\n";
  EXPECT_NE(print(), first) << "motor";
  fs::copy_file(DRIVEBENCH_CONFIGS "/motors/servo-im.toml", motor, fs::copy_options::overwrite_existing);
  EXPECT_EQ(print(), first);
}

}  // namespace
}  // namespace drivebench::regression::results_test
