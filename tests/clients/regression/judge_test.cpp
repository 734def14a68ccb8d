#include "clients/regression/verdicts/judge.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/regression/checks/check_reader.hpp"
#include "clients/regression/reports/reports.hpp"
#include "tests/clients/regression/report_text.hpp"

namespace drivebench::regression::judge_test {
namespace {

Case case_with(double largest_speed) {
  Case c{.name = "a <b>", .file = "a.toml", .bench = "x"};
  c.device.kind = DeviceUnderTest::Kind::kPreset;
  CheckSpec spec;
  spec.kind = &check_kinds()[0];
  spec.name = "speed";
  spec.axis = "two";
  spec.line = 12;
  spec.signal = find_signal("speed_rad_s");
  spec.numbers = {{"max", largest_speed}};
  c.checks.push_back(spec);
  return c;
}

const RunFacts kTwoAxes{.period_s = 0.001, .end_tick = 10, .axes = {"one", "two"}, .faults = {}};

/// Twelve ticks: the second axis reaches 5 rad/s at tick 10, and 50 after the end of the case.
CaseResult run(const Case& c, std::uint64_t state = 1, std::uint64_t owner = 3, std::uint64_t late = 0) {
  Judge judge(c, kTwoAxes, false);
  for (std::uint64_t tick = 0; tick < 12; ++tick) {
    std::vector<Sample> axes(2);
    for (Sample& sample : axes) {
      sample.tick = tick;
      sample.state = state;
      sample.owner = owner;
      sample.late_ticks = late;
    }
    axes[1].speed_rad_s = tick == 10 ? 5.0 : tick == 11 ? 50.0 : 1.0;
    judge.see(axes);
  }
  return judge.result();
}

// Catches: a check on the wrong axis, or on samples after the end.
TEST(Judge, ShowsEachCheckItsAxisUpToTheEnd) {
  EXPECT_EQ(run(case_with(5.0)).verdict, Verdict::kPass);
  const CaseResult failed = run(case_with(4.9));
  EXPECT_EQ(failed.verdict, Verdict::kFail);
  EXPECT_EQ(failed.findings[0].measured, 5.0);
  EXPECT_EQ(failed.samples, 22U);
  EXPECT_EQ(failed.bench_s, 0.010);
}

// Catches: a run that passes although nothing ever drove it.
TEST(Judge, ADeviceThatNeverArmedIsAnError) {
  EXPECT_EQ(run(case_with(5.0), 5).verdict, Verdict::kError);
  Case open = case_with(5.0);
  open.device.kind = DeviceUnderTest::Kind::kNone;
  EXPECT_EQ(run(open, 0).verdict, Verdict::kPass);
}

// Catches: the bench's own lateness blamed on the device, or ignored.
TEST(Judge, LateTicksInRealTimeMakeTheRunInvalid) {
  Case c = case_with(5.0);
  c.is_realtime = true;
  EXPECT_EQ(run(c, 1, 3, 2).verdict, Verdict::kInvalid);
  EXPECT_EQ(run(c, 1, 3, 0).verdict, Verdict::kPass);
}

// Catches: a step that acted while an attached drive was still asleep, told as one that never did.
TEST(Judge, AStepMayActBeforeAnAttachedDriveArms) {
  Case c = case_with(50.0);
  c.device.kind = DeviceUnderTest::Kind::kAttached;
  Step step{.line = 7};
  step.when =
      CaseCondition{"speed_rad_s > 40", std::get<NamedCondition>(parse_condition("two.speed_rad_s > 40"))};
  c.steps.push_back(step);
  Judge judge(c, kTwoAxes, false);
  for (std::uint64_t tick = 0; tick < 50; ++tick) {
    std::vector<Sample> axes(2);
    for (Sample& sample : axes)
      sample = {.tick = tick, .state = tick < 20 ? 5u : 1u};
    axes[1].speed_rad_s = tick < 20 ? 50.0 : 5.0;
    judge.see(axes);
  }
  const CaseResult result = judge.result();
  EXPECT_EQ(result.verdict, Verdict::kPass) << result.reason;
}

// Catches: a case with an attached drive whose time, late ticks or end are those of the bench.
TEST(Judge, TheTimeOfAnAttachedDriveBeginsWhenItArms) {
  Case c = case_with(5.0);
  c.device.kind = DeviceUnderTest::Kind::kAttached;
  c.is_realtime = true;
  Judge judge(c, kTwoAxes, false);
  for (std::uint64_t tick = 0; tick < 50; ++tick) {
    std::vector<Sample> axes(2);
    for (Sample& sample : axes) {
      sample.tick = tick;
      sample.state = tick < 20 ? 5 : 1;
      sample.late_ticks = 3;  // all of them before
    }
    axes[1].speed_rad_s = tick < 20 || tick > 30 ? 50.0 : 5.0;
    EXPECT_EQ(judge.begin_tick().has_value(), tick > 20) << tick;
    EXPECT_EQ(judge.is_over(tick), tick > 30) << tick;
    judge.see(axes);
  }
  const CaseResult result = judge.result();
  EXPECT_EQ(result.verdict, Verdict::kPass) << result.reason;
  EXPECT_EQ(result.samples, 22U);
  EXPECT_EQ(result.bench_s, 0.010);
}

// Catches: a stimulus that never came, one that needs its condition for one tick less or more, one after the
// end.
TEST(Judge, AStepThatNeverActedFailsTheCase) {
  Case c = case_with(5.0);
  Step step{.line = 7};
  step.when =
      CaseCondition{"speed_rad_s < 2", std::get<NamedCondition>(parse_condition("two.speed_rad_s < 2"))};
  step.for_s = 0.009;  // the ticks 0 to 9
  c.steps = {step};
  EXPECT_EQ(run(c).verdict, Verdict::kPass);
  c.steps[0].for_s = 0.010;
  const CaseResult result = run(c);
  EXPECT_EQ(result.verdict, Verdict::kFail);
  EXPECT_EQ(result.reason, "the step of line 7 never acted: \"speed_rad_s < 2\" never held");
  ProblemList problems;
  step.when.reset();
  step.at_s = 0.010;
  c.steps = {step};
  check_on_bench(c, kTwoAxes, problems);
  EXPECT_THROW(problems.throw_if_any(), ConfigError);
}

// Catches: a hash that depends on the number of a session, or that does not see the samples.
TEST(Judge, EqualRunsHaveEqualHashes) {
  const std::uint64_t hash = run(case_with(5.0)).hash;
  EXPECT_EQ(run(case_with(4.0), 1, 9).hash, hash);
  EXPECT_NE(run(case_with(5.0), 2).hash, hash);
}

std::vector<CaseResult> one_of_each() {
  std::vector<CaseResult> results(5);
  results[0] = run(case_with(5.0));
  results[1] = run(case_with(4.0));
  results[2].name = "dead";
  results[2].file = "d,1.toml";
  results[2].reason = "ended with code 1";
  results[2].output = "one\ntwo\x1b\nthree\n4\n5\n6 & 7\n";
  results[3].name = "late";
  results[3].verdict = Verdict::kInvalid;
  results[3].reason = "2 ticks were late";
  results[4].name = "not # here";
  results[4].verdict = Verdict::kSkipped;
  results[4].reason = "no board";
  return results;
}

// Catches: a kind of verdict that a report leaves out or counts as another.
TEST(Reports, TellEveryVerdict) {
  const std::vector<CaseResult> results = one_of_each();
  EXPECT_EQ(totals_text(suite_results(results).totals), "1 passed, 1 failed, 1 error, 1 invalid, 1 skipped");
  EXPECT_EQ(
      text_of(tap_report, results),
      "TAP version 13\n1..5\nok 1 - a <b>\nnot ok 2 - a <b>\n# fail: speed: at most 5 rad/s, max 4 rad/s, at "
      "0.01 s (line 12)\nnot ok 3 - dead\n# error: ended with code 1\nnot ok 4 - late\n# invalid: 2 ticks "
      "were "
      "late\nok 5 - not _ here # SKIP no board\n");
  EXPECT_EQ(text_of(github_report, results),
            "::error file=a.toml,line=12,title=fail a <b>::speed: at most 5 rad/s, max 4 rad/s, at 0.01 s "
            "(line 12)\n"
            "::error file=d%2C1.toml,line=1,title=error dead::ended with code 1\n"
            "::warning file=,line=1,title=invalid late::2 ticks were late\n");
}

// Catches: text of a program that breaks the XML, or a failure without its sentence.
TEST(Reports, JunitEscapesWhatProgramsPrint) {
  const std::string xml = text_of(junit_report, one_of_each());
  EXPECT_NE(xml.find("tests=\"5\" failures=\"1\" errors=\"2\" skipped=\"1\""), std::string::npos) << xml;
  EXPECT_NE(xml.find("name=\"a &lt;b&gt;\""), std::string::npos);
  EXPECT_NE(xml.find("<failure type=\"fail\" message=\"speed: at most 5 rad/s"), std::string::npos);
  EXPECT_NE(xml.find("<system-out>one\ntwo?\nthree\n4\n5\n6 &amp; 7\n</system-out>"), std::string::npos)
      << xml;
}

// Catches: a report of parts that are no document together.
TEST(Reports, JsonOfPartsIsWhatAWholeDocumentWouldBe) {
  for (const auto& results : {one_of_each(), std::vector<CaseResult>(), std::vector<CaseResult>(1)}) {
    const std::string text = text_of(json_report, results);
    const auto document = nlohmann::ordered_json::parse(text);
    EXPECT_EQ(document.dump(1) + "\n", text);
    EXPECT_EQ(document.at("cases").size(), results.size());
  }
}

// Catches: results that are read for each report again, and parts that go into the wrong report.
TEST(Reports, AreWrittenTogetherFromOneLook) {
  SuiteResults results = suite_results(one_of_each());
  int looks = 0;
  results.each = [&looks, each = results.each](const SeeResult& see) {
    ++looks;
    each(see);
  };
  std::array<std::string, 2> texts;
  const auto into = [](std::string& text) { return [&text](std::string_view part) { text += part; }; };
  const std::array reports{json_report(into(texts[0])), junit_report(into(texts[1]))};
  write_reports(results, reports);
  EXPECT_EQ(looks, 1);
  EXPECT_EQ(texts[0], text_of(json_report, one_of_each()));
  EXPECT_EQ(texts[1], text_of(junit_report, one_of_each()));
}

// Catches: a number that JSON does not have.
TEST(Reports, JsonHasNoNumberThatIsNone) {
  const std::string json = text_of(json_report, one_of_each());
  EXPECT_EQ(json.find("nan"), std::string::npos);
  EXPECT_NE(json.find("\"verdict\": \"invalid\""), std::string::npos);
}

// Catches: a terminal that a program's output can move, or a reader who must look for it elsewhere.
TEST(Reports, TheTableShowsTheEndOfTheOutput) {
  const std::string row = table_row(one_of_each()[2]);
  EXPECT_EQ(row.find("one"), std::string::npos);
  EXPECT_NE(row.find("        | two?\n"), std::string::npos) << row;
  EXPECT_NE(row.find("        | 6 & 7\n"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::regression::judge_test
