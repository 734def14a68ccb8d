#include "tests/benchmark/harness/report.hpp"

#include <gtest/gtest.h>

namespace drivebench::speed::report_test {
namespace {

Row tick() {
  return {.name = "tick",
          .unit = "ns",
          .measured = 558.0,
          .floor = 225.0,
          .limit = Limit{Limit::Kind::kRatioAtMost, 4.0}};
}

/// Catches: a ratio of the wrong two figures, a limit or a unit that is left out, a row that is lost.
TEST(BenchmarkReport, MarkdownHasARowForEachFigure) {
  Row memory{.name = "memory", .unit = "MiB", .measured = 25.0, .limit = Limit{Limit::Kind::kAtMost, 64.0}};
  const std::string text = as_markdown("A CPU, 2 CPUs", "2026-11-23", {tick(), memory});
  EXPECT_NE(text.find("on 2026-11-23.\n\nA CPU, 2 CPUs\n"), std::string::npos) << text;
  EXPECT_TRUE(
      text.ends_with("|---|---|---|---|---|\n"
                     "| tick | 558 ns | 225 ns | 2.48 | <= 4.00 x |\n"
                     "| memory | 25.0 MiB |  |  | <= 64.0 MiB |\n"))
      << text;
}

/// Catches: a figure over its limit, or measured beside others, that reads like a good one.
TEST(BenchmarkReport, MarkdownMarksFiguresOverTheirLimitNotJudgedAndSkipped) {
  Row over = tick();
  over.measured = 1000.0;
  Row disturbed = tick();
  disturbed.disturbance.gone = 0.5;
  Row slowed = tick();
  slowed.disturbance.slowed = 0.06;
  Row skipped{.name = "socketcan", .note = "no kernel CAN", .skipped = true};
  Row information{.name = "late ticks", .measured = 3.0};
  const std::string text =
      as_markdown("A CPU", "2026-11-23", {over, disturbed, slowed, skipped, information});
  EXPECT_TRUE(
      text.ends_with("| tick | 1000 ns | 225 ns | 4.44 | <= 4.00 x, over |\n"
                     "| tick | 558 ns | 225 ns | 2.48 | <= 4.00 x, not judged |\n"
                     "| tick | 558 ns | 225 ns | 2.48 | <= 4.00 x, not judged |\n"
                     "| socketcan (no kernel CAN) | skipped | | | |\n"
                     "| late ticks | 3.00 |  |  |  |\n"))
      << text;
}

}  // namespace
}  // namespace drivebench::speed::report_test
