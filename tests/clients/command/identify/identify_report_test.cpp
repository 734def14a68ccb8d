#include "clients/command/identify/identify_report.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "clients/command/identify/identify_json.hpp"

namespace drivebench::command::identify_report_test {
namespace {

IdentifyReport some_report() {
  IdentifyReport report;
  report.motor = "dc";
  report.source = "file <x>";
  report.period_s = 1e-4;
  report.result = {.kind = "pm_dc", .method = "DC motor"};
  report.result.parameters = {
      {"R", "ohm", 2.02, 0.03, 2.0}, {"L", "H", 2.5e-3, 1e-4, 2e-3}, {"J", "kg*m^2", 6e-5, 0.0, {}}};
  report.result.samples = 3;
  report.result.excitation = {.sufficient = false, .unseen = {"J"}, .verdict = "not identifiable: J"};
  identification::Resimulation validation;
  validation.period_s = 1e-4;
  validation.signals = {{"i_a_a", "A", {0, 1, 2}, {0, 1.5, 2}, 0.25, 0.35},
                        {"speed_rad_s", "rad/s", {1, 1, 1}, {1, 1, 1}, 0.0, std::nan("")}};
  report.validation = validation;
  return report;
}

// Catches: a table that shows what was not seen, or says nothing about how good the index was.
TEST(IdentifyReport, TheTextHasEstimateIndexTruthErrorAndVerdict) {
  const std::string text = identify_text(some_report());
  for (const char* part : {"R      ohm                  2.02          -            2        1 %           "
                           "2.02     1.49 %  inside the index\n",
                           "outside the index", "not seen", "verdict: not identifiable: J\n",
                           "i_a_a 0.25 A (35.00 %)", "speed_rad_s 0 rad/s", "advanced by 0.5 samples"})
    EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
}

// Catches: residuals of the wrong sign or of two units in one panel, a picture without the measured or
// without the re-simulated signals, and a report that links to none.
TEST(IdentifyReport, PictureAndMarkdownShowTheValidation) {
  IdentifyReport report = some_report();
  const std::string svg = identify_plot(report);
  for (const char* part : {"measured", "re-simulated", "i_a [A]", "speed [rad/s]", "residual [A]",
                           "residual [rad/s]", "file &lt;x&gt;"})
    EXPECT_NE(svg.find(part), std::string::npos) << part;
  // The residual of the current goes down to -0.5 A in the middle: the axis of its panel is below zero.
  EXPECT_NE(svg.find(">-0.5</text>"), std::string::npos) << svg;
  const std::string markdown = identify_markdown(report, "x.svg");
  EXPECT_NE(markdown.find("| R | ohm | 2.02 | - | 2 | 1 % | yes | 2.02 | 1.49 % |"), std::string::npos)
      << markdown;
  EXPECT_NE(markdown.find("![measured and re-simulated](x.svg)"), std::string::npos);
  EXPECT_EQ(identify_markdown(report, "").find("!["), std::string::npos);
  report.validation.reset();
  report.validation_problem = "no re-simulation: J";
  EXPECT_THROW(identify_plot(report), std::runtime_error);
  EXPECT_NE(identify_text(report).find("no re-simulation: J"), std::string::npos);
}

// Catches: a key that clients read under another name, and a number that JSON does not have.
TEST(IdentifyReport, JsonHasParametersSettingsAndValidation) {
  const nlohmann::json json = nlohmann::json::parse(identify_json(some_report()));
  EXPECT_EQ(json["parameters"]["R"]["estimate"], 2.02);
  EXPECT_EQ(json["parameters"]["R"]["truth"], 2.0);
  EXPECT_TRUE(json["parameters"]["J"]["estimate"].is_null());
  EXPECT_EQ(json["motor"], "dc");
  EXPECT_EQ(json["settings"]["voltage_shift"], 0.5);
  EXPECT_EQ(json["validation"]["signals"]["i_a_a"]["normalised"], 0.35);
  EXPECT_TRUE(json["validation"]["signals"]["speed_rad_s"]["normalised"].is_null());
  EXPECT_TRUE(json["experiment"].is_null());
}

}  // namespace
}  // namespace drivebench::command::identify_report_test
