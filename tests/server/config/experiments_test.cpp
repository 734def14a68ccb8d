// Section [experiments] of bench files.
#include <gtest/gtest.h>

#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::experiments_test {
namespace {

using namespace test;

/// Its section begins in line 21.
std::string with_experiments(const std::string& lines) {
  return kBench + "[experiments]\n" + lines;
}

// Catches: a limit that is not checked, a key that is not read, a folder that the file does not name, and
// more experiments than one answer can list.
TEST(ConfigExperiments, EveryKeyHasItsRule) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"kept = 3\n", ":21: experiments.folder"},
      {"folder = \"\"\n", ":22: experiments.folder"},
      {"folder = \"e\"\nqueue_length = 0\n", ":23: experiments.queue_length is 0 but must lie between 1 and"},
      {"folder = \"e\"\nlongest_s = 1e9\n", ":23: experiments.longest_s is 1e+09 but must lie between"},
      {"folder = \"e\"\ntable_rows = -1\n", ":23: experiments.table_rows is -1 but must lie between 0 and"},
      {"folder = \"e\"\nkept = 0\n", ":23: experiments.kept is 0 but must lie between 1 and"},
      {"folder = \"e\"\nqueue_length = 101\n",
       ":23: experiments.queue_length is 101 but must lie between 1 and 100"},
      {"folder = \"e\"\nkept = 301\n", ":23: experiments.kept is 301 but must lie between 1 and 300"},
      {"folder = \"e\"\nkeep = 9\n", ":23: experiments.keep is not a known key"},
  };
  for (const auto& [lines, said] : cases) {
    const std::string found = problems_of(with_experiments(lines));
    EXPECT_EQ(found.find("b.toml" + said), 0u) << lines << "  gave: " << found;
  }
}

// Catches: a folder beside the program instead of beside the bench file, a folder that the file does not ask
// for, and a recording that contains paths of its server.
TEST(ConfigExperiments, TheFolderLiesBesideTheBenchFileAndIsNotRecorded) {
  EXPECT_TRUE(parse(kBench).experiments.folder.empty());
  const BenchConfig config = parse(with_experiments(
      "folder = \"kept/here\"\nqueue_length = 4\nlongest_s = 2.5\ntable_rows = 9\nkept = 7\n"));
  EXPECT_EQ(config.experiments.folder, "/nonexistent/kept/here");
  EXPECT_EQ(config.experiments.queue_length, 4u);
  EXPECT_EQ(config.experiments.longest_s, 2.5);
  EXPECT_EQ(config.experiments.table_rows, 9u);
  EXPECT_EQ(config.experiments.kept, 7u);
  EXPECT_EQ(to_toml(config).find("experiments"), std::string::npos);
  EXPECT_NE(problems_of(with_experiments("folder = \"e\"\n"), {}), "none");
}

}  // namespace
}  // namespace drivebench::experiments_test
