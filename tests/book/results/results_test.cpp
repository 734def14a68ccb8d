#include "tests/book/results/results.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

namespace drivebench::results_test {
namespace {

// Catches: a controller, a preset or a plant that has changed without the table, and a table written by hand.
TEST(Results, TheTableEqualsTheResultsOfTheExperiments) {
  std::ifstream file(DRIVEBENCH_RESULTS, std::ios::binary);
  ASSERT_TRUE(file) << DRIVEBENCH_RESULTS;
  std::ostringstream text;
  text << file.rdbuf();
  for (const std::string& difference : differences(text.str(), all_results()))
    ADD_FAILURE() << difference;
}

// Catches: a comparison that accepts another number, another unit, a row less or a row more.
TEST(Results, DifferencesAreFound) {
  const std::vector<ResultSection> sections = {
      {"title", {{"1", "a run", "below 2", {counts("peak error", 1.5), number("", 3.0, "A")}, "agrees"}}}};
  const std::string text = markdown_of(sections);
  EXPECT_TRUE(differences(text, sections).empty());
  const auto with = [&text](const std::string& old_part, const std::string& new_part) {
    std::string changed = text;
    changed.replace(changed.find(old_part), old_part.size(), new_part);
    return changed;
  };
  EXPECT_TRUE(differences(with("1.5 counts; 3 A", "1.8 counts; 3.05 A"), sections).empty());
  EXPECT_EQ(differences(with("1.5 counts", "2.2 counts"), sections).size(), 1U);
  EXPECT_EQ(differences(with("3 A", "3.1 A"), sections).size(), 1U);
  EXPECT_EQ(differences(with("3 A", "3 V"), sections).size(), 1U);
  EXPECT_EQ(differences(with("3 A", "x A"), sections).size(), 1U);
  EXPECT_EQ(differences(with("; 3 A", ""), sections).size(), 1U);
  EXPECT_EQ(differences(with("below 2", "below 3"), sections).size(), 1U);
  EXPECT_EQ(differences(with("## title", "## other"), sections).size(), 1U);
  EXPECT_EQ(differences(text + "| more |\n", sections).size(), 1U);
  EXPECT_EQ(differences("", sections).size(), 1U);
}

}  // namespace
}  // namespace drivebench::results_test
