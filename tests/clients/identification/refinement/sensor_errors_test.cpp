#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "clients/identification/identify.hpp"
#include "clients/identification/resimulation.hpp"
#include "tests/clients/identification/monte_carlo/random_motors.hpp"

namespace drivebench::identification::sensor_errors_test {
namespace {

/// Motor 2 of a kind with encoder and converters of 12 bits, white noise of one step.
struct Case {
  const MotorDraw& draw;
  Recorded run;

  explicit Case(MotorKind kind) : draw(draw_of(kind)), run(record_motor(draw, 2, 1)) {}
  static const MotorDraw& draw_of(MotorKind kind) {
    for (const MotorDraw& each : motor_draws()) {
      if (each.kind == kind) return each;
    }
    return motor_draws().front();
  }
  void disturb(const std::string& name, double gain, double offset) {
    for (Column& column : run.data.columns) {
      if (column.name != name) continue;
      for (double& x : column.values)
        x = gain * x + offset;
    }
  }
};

/// Every parameter and every error of a sensor is stated within twice its 95 % interval of the truth.
void expect_found(const Case& c, const Result& r, const std::map<std::string, double>& errors) {
  EXPECT_TRUE(r.excitation.sufficient) << to_markdown(r);
  const std::vector<double> motor = draw_motor(c.draw, 2);
  for (std::size_t k = 0; k < c.draw.identified.size(); ++k) {
    const Estimate* const e = r.find(c.draw.identified[k].name);
    ASSERT_NE(e, nullptr);
    EXPECT_LT(std::abs(e->value - motor[k]), 2.0 * e->interval.value_or(0.0)) << e->name << "\n"
                                                                              << to_markdown(r);
  }
  for (const Estimate& e : r.sensors) {
    const auto known = errors.find(e.name);
    const double truth = known != errors.end() ? known->second : e.unit == "1" ? 1.0 : 0.0;
    EXPECT_LT(std::abs(e.value - truth), 2.0 * e.interval.value_or(0.0)) << sensor_text(e);
  }
}

double widest(const Result& r, const std::string& what) {
  double most = 0.0;
  for (const Estimate& e : r.sensors) {
    if (e.name.find(what) != std::string::npos) most = std::max(most, e.interval.value_or(HUGE_VAL));
  }
  return most;
}

// 0.3 A beside some 5 A. Catches: an offset that goes into R or the friction, one of the wrong sign, a
// residual with the measured current where the voltages are corrected.
TEST(SensorErrors, AnOffsetOfTheCurrentOfADcMotorIsFound) {
  Case c(MotorKind::kDc);
  c.disturb("i_a_a", 1.0, 0.3);
  EXPECT_GT(std::abs(identify(c.run.data, c.run.how).at("f") / draw_motor(c.draw, 2)[4] - 1.0), 0.01);
  c.run.how.sensors.current_offsets = true;
  const Result r = identify(c.run.data, c.run.how);
  ASSERT_EQ(r.sensors.size(), 1U);
  expect_found(c, r, {{"i_a_a offset", 0.3}});
  EXPECT_LT(widest(r, "offset"), 0.03) << to_markdown(r);
  // The re-simulation compares with what the sensors should have shown.
  EXPECT_LT(resimulate(c.run.data, c.run.how, r).signals[0].normalised, 0.02);
}

// Offsets of all currents and different gains in a star. Catches: the gain of another phase, offset times
// gain.
TEST(SensorErrors, OffsetsAndGainsOfAnInductionMotorAreFound) {
  Case c(MotorKind::kInduction);
  c.disturb("i_a_a", 1.0, 0.1);
  c.disturb("i_b_a", 1.005, -0.15);
  c.disturb("u_c_v", 0.997, 0.0);
  c.run.how.sensors = {.current_offsets = true, .gains = true};
  const Result r = identify(c.run.data, c.run.how);
  ASSERT_EQ(r.sensors.size(), 7U) << to_markdown(r);
  expect_found(
      c, r, {{"i_a_a offset", 0.1}, {"i_b_a offset", -0.15}, {"i_b_a gain", 1.005}, {"u_c_v gain", 0.997}});
  EXPECT_LT(widest(r, "gain"), 2e-3) << to_markdown(r);
  EXPECT_LT(widest(r, "offset"), 0.03) << to_markdown(r);
}

// Catches: an offset that is stated without regard to its twin, a phase a of a star's voltages that nothing
// shows.
TEST(SensorErrors, OffsetsOfVoltagesAndCurrentsOfAMagnetMotorAreFoundAsFarAsTheTorqueTellsThem) {
  for (const MotorKind kind : {MotorKind::kPmSynchronous, MotorKind::kBldc}) {
    Case c(kind);
    c.disturb("i_b_a", 1.0, 0.25);
    c.disturb("u_b_v", 1.0, -0.2);
    c.run.how.sensors = {.current_offsets = true, .voltage_offsets = true};
    const Result r = identify(c.run.data, c.run.how);
    ASSERT_EQ(r.sensors.size(), kind == MotorKind::kBldc ? 5U : 4U);
    expect_found(c, r, {{"i_b_a offset", 0.25}, {"u_b_v offset", -0.2}});
    EXPECT_NE(to_markdown(r).find("look alike but for the torque"), std::string::npos);
  }
}

// Catches: a gain of all currents that is guessed from data that do not have it.
TEST(SensorErrors, AGainThatAllCurrentsShareGoesIntoTheParameters) {
  Case c(MotorKind::kPmSynchronous);
  const double before = identify(c.run.data, c.run.how).at("R_S");
  c.disturb("i_a_a", 1.1, 0.0);
  c.disturb("i_b_a", 1.1, 0.0);
  c.run.how.sensors.gains = true;
  const Result r = identify(c.run.data, c.run.how);
  EXPECT_NEAR(r.at("R_S") * 1.1 / before, 1.0, 2e-3);
  EXPECT_NE(to_markdown(r).find("goes into the parameters as it is"), std::string::npos);
}

// A DC motor has one current: nothing stands beside it. Catches: a search that looks for nothing and reports
// that it found gains.
TEST(SensorErrors, TheGainsOfADcMotorAreRefused) {
  Case c(MotorKind::kDc);
  c.run.how.sensors.gains = true;
  try {
    identify(c.run.data, c.run.how);
    FAIL() << "a gain was looked for";
  } catch (const IdentificationError& error) {
    EXPECT_NE(std::string(error.what()).find("looks like another R, L, K_T and J"), std::string::npos)
        << error.what();
  }
}

// Of a motor that is refused no error is known, and of one that stands nearly still no gain. Catches: "+- 0"
// beside a start value, in text or JSON, and a number that noise made.
TEST(SensorErrors, OneThatTheDataDoNotTellShowsNoNumber) {
  Case wrong(MotorKind::kPmSynchronous);
  wrong.run.how.sensors = {.current_offsets = true, .gains = true};
  Case part = wrong;
  wrong.run.how.pole_pairs = 53;
  part.run.how.processing.from_s = 0.0;
  part.run.how.processing.to_s = 0.002;
  for (const Case& c : {wrong, part}) {
    const Result r = identify(c.run.data, c.run.how);
    EXPECT_FALSE(r.excitation.sufficient);
    ASSERT_FALSE(r.sensors.empty());
    for (const Estimate& e : r.sensors)
      EXPECT_EQ(sensor_text(e), e.name + ": the data do not tell");
    EXPECT_NE(to_json(r).find("\"i_b_a gain\": {\n      \"estimate\": null,\n      \"interval\": null"),
              std::string::npos)
        << to_json(r);
  }
}

// Catches: an hour's record that takes an hour, or a part of it that passes for the whole.
TEST(Refinement, ALongRecordIsCutAndSaysSo) {
  Case c(MotorKind::kDc);
  c.run.how.most_samples = 4000;
  const Result r = identify(c.run.data, c.run.how);
  EXPECT_NE(to_markdown(r).find("refined from the first 4000 of 9960 samples"), std::string::npos)
      << to_markdown(r);
  EXPECT_GT(*r.find("L")->interval,
            *identify(Case(MotorKind::kDc).run.data, Case(MotorKind::kDc).run.how).find("L")->interval);
}

}  // namespace
}  // namespace drivebench::identification::sensor_errors_test
