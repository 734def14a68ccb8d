#include "clients/identification/data/result.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "server/config/config.hpp"

namespace drivebench::identification::result_test {
namespace {

Result some_result() {
  Result r = {.kind = "induction", .method = "a method"};
  r.parameters = {{"R_S", "ohm", 9.7, 0.1, {}},    {"L_S", "H", 0.67, 0.01, {}},
                  {"M", "H", 0.64, 0.01, {}},      {"R_R", "ohm", 8.0, HUGE_VAL, {}},
                  {"J", "kg*m^2", 0.011, 0.0, {}}, {"f", "N*m*s/rad", -1e-5, 0.0, {}}};
  r.excitation.verdict = "the data see every parameter";
  return r;
}

// Catches: a truth beside the wrong parameter, a number that JSON does not have, the form that clients read.
TEST(IdentificationResult, AsJson) {
  Result r = some_result();
  r.compare({{"R_S", 10.0}, {"unknown", 1.0}});
  const nlohmann::json json = nlohmann::json::parse(to_json(r));
  EXPECT_EQ(json["parameters"]["R_S"]["estimate"], 9.7);
  EXPECT_EQ(json["parameters"]["R_S"]["index"], 0.1);
  EXPECT_EQ(json["parameters"]["R_S"]["truth"], 10.0);
  EXPECT_TRUE(json["parameters"]["L_S"]["truth"].is_null());
  EXPECT_TRUE(json["parameters"]["R_R"]["index"].is_null());
  EXPECT_EQ(json["identifiable"], true);
}

// An index that held the truth says so, one that did not too. Catches: a comparison of the relative with the
// absolute, a verdict without truth.
TEST(IdentificationResult, ReportsWhetherTheIndexHeldTheTruth) {
  Result r = some_result();
  r.compare({{"R_S", 9.79}, {"L_S", 0.69}});
  EXPECT_EQ(is_inside(r, *r.find("R_S")), true);
  EXPECT_EQ(is_inside(r, *r.find("L_S")), false);
  EXPECT_EQ(is_inside(r, *r.find("M")), std::nullopt);
  const nlohmann::json json = nlohmann::json::parse(to_json(r));
  EXPECT_EQ(json["parameters"]["R_S"]["inside"], true);
  EXPECT_EQ(json["parameters"]["L_S"]["inside"], false);
  EXPECT_TRUE(json["parameters"]["M"]["inside"].is_null());
  EXPECT_NE(to_markdown(r).find("| L_S | H | 0.67 | - | 0.69 | -2.9 % | no | 0.67 | 1.49 % |"),
            std::string::npos);
  r.compare({{"R_S", 10.0}});  // 3 % away, with an index of 0.1 ohm
  EXPECT_EQ(is_inside(r, *r.find("R_S")), false);
  r.excitation.unseen = {"R_S"};
  EXPECT_EQ(is_inside(r, *r.find("R_S")), std::nullopt);
}

// A refined estimate is judged by its interval, not by the index of the equations, whose value stays beside
// it. Catches: an index that flatters a refined estimate, a JSON without the interval.
TEST(IdentificationResult, ARefinedEstimateIsJudgedByItsInterval) {
  Result r = some_result();
  r.compare({{"R_S", 9.75}});
  Estimate& e = *r.find("R_S");
  e.by_equations = 9.6;
  e.interval = 0.03;
  EXPECT_EQ(is_inside(r, e), false);
  EXPECT_NE(to_markdown(r).find("| R_S | ohm | 9.7 | 0.309 % | 9.75 | -0.513 % | no | 9.6 | 1.04 % |"),
            std::string::npos)
      << to_markdown(r);
  const nlohmann::json json = nlohmann::json::parse(to_json(r));
  EXPECT_EQ(json["parameters"]["R_S"]["interval"], 0.03);
  EXPECT_EQ(json["parameters"]["R_S"]["by_equations"], 9.6);
  r.excitation = {.sufficient = false, .unseen = {"R_S"}, .verdict = "no"};
  EXPECT_EQ(to_json(r).find("9.6"), std::string::npos);
  EXPECT_EQ(to_markdown(r).find("9.6"), std::string::npos);
}

// Catches: a number in the table that the data do not hold.
TEST(IdentificationResult, UnseenParametersShowNoNumber) {
  Result r = some_result();
  r.excitation = {.sufficient = false, .unseen = {"L_S"}, .verdict = "not identifiable: L_S"};
  EXPECT_NE(to_markdown(r).find("| L_S | H | not seen | - | - | - |"), std::string::npos) << to_markdown(r);
  EXPECT_NE(to_markdown(r).find("| R_S | ohm | 9.7 | - | - | - | - | 9.7 | 1.03 % |"), std::string::npos)
      << to_markdown(r);
  EXPECT_TRUE(nlohmann::json::parse(to_json(r))["parameters"]["L_S"]["estimate"].is_null());
  EXPECT_THROW(to_motor_toml(r, {.name = "x"}), IdentificationError);
}

BenchConfig bench_of(const Result& r, const MotorFile& file) {
  const std::string motor = to_motor_toml(r, file);
  const std::size_t machine = motor.find("[machine]");
  const std::size_t mechanics = motor.find("[mechanics]");
  std::string text =
      "[bench]\nname = \"b\"\nmode = \"free\"\nperiod_us = 100\n[[axis]]\nname = "
      "\"a\"\n[axis.amplifier]\nvoltage_limit_v = 40.0\nover_current_a = "
      "9.0\n[axis.encoder]\ncounts_per_revolution = 2000\n";
  text += "[axis.machine]\n" + motor.substr(machine + 10, mechanics - machine - 10);
  text += "[axis.mechanics]\n" + motor.substr(mechanics + 12);
  return parse_config(text, "made", {});
}

// The bench reads the motor file that identification writes, for every kind, with names that need quoting.
// Catches: a key that the bench does not know, negative friction, a reserved character in a name,
// L_d for both axes, a star that comes back as two phases.
TEST(IdentificationResult, TheBenchReadsTheMotorFile) {
  const BenchConfig im =
      bench_of(some_result(), {.name = "a \"motor\"\n", .source = "C:\\x", .pole_pairs = 2});
  const auto& machine = std::get<InductionMachineParameters>(im.setup.axes[0].parameters.machine);
  EXPECT_EQ(machine.rotor_inductance_h, 0.67);
  EXPECT_TRUE(to_motor_toml(some_result(), {.name = "a \"motor\"\n", .source = "C:\\x"})
                  .starts_with("name = \"a \\\"motor\\\"\\u000A\"\nsource = \"C:\\\\x\"\n"));
  EXPECT_EQ(machine.rotor_resistance_ohm, 8.0);
  EXPECT_EQ(machine.pole_pairs, 2);
  Result dc = {.kind = "pm_dc", .method = "m"};
  dc.parameters = {{"L", "H", 2e-3, 0, {}},
                   {"R", "ohm", 2, 0, {}},
                   {"K_T", "N*m/A", 0.07, 0, {}},
                   {"J", "", 6e-5, 0, {}},
                   {"f", "", 4e-4, 0, {}}};
  EXPECT_EQ(bench_of(dc, {}).setup.axes[0].parameters.mechanics.inertia_kgm2, 6e-5);
  Result pm = {.kind = "pm_synchronous", .method = "m"};
  pm.parameters = {{"R_S", "ohm", 0.6, 0, {}}, {"L_S", "H", 2.4e-3, 0, {}}, {"K_m", "", 0.515, 0, {}},
                   {"J", "", 1.9e-4, 0, {}},   {"f", "", 3e-3, 0, {}},      {"f_c", "", 0.07, 0, {}}};
  EXPECT_EQ(bench_of(pm, {.pole_pairs = 50}).setup.axes[0].parameters.mechanics.coulomb_friction_nm, 0.07);
  pm.parameters[1] = {"L_d", "H", 1.8e-3, 0, {}};
  pm.parameters.push_back({"L_q", "H", 4.2e-3, 0, {}});
  const BenchConfig salient = bench_of(pm, {.pole_pairs = 4, .star = true});
  const auto& buried = std::get<PmMachineParameters>(salient.setup.axes[0].parameters.machine);
  EXPECT_EQ(buried.inductance_d_h, 1.8e-3);
  EXPECT_EQ(buried.inductance_q_h, 4.2e-3);
  EXPECT_TRUE(buried.star);
  Result bldc = {.kind = "bldc", .method = "m"};
  bldc.parameters = {{"R_S", "ohm", 0.7, 0, {}},
                     {"L+M", "H", 2.87e-3, 0, {}},
                     {"tau_p", "", 0.5128, 0, {}},
                     {"J", "", 2e-4, 0, {}},
                     {"f", "", 2e-3, 0, {}}};
  EXPECT_EQ(
      std::get<BldcMachineParameters>(bench_of(bldc, {}).setup.axes[0].parameters.machine).self_inductance_h,
      2.87e-3);
  dc.parameters[1].value = -2.0;
  EXPECT_THROW(to_motor_toml(dc, {}), IdentificationError);
}

/// Magnetising current lambda/0.64 H (1 + (lambda/1.6 Wb)^4), equal leakages of 0.03 H.
Result saturated_result() {
  Result r = {.kind = "saturated_induction", .method = "m"};
  r.parameters = {{"R_S", "ohm", 9.7, 0, {}},  {"T_R", "s", 0.67 / 8.6, 0, {}},
                  {"L_S", "H", 0.67, 0, {}},   {"sigma", "1", 1.0 - 0.64 * 0.64 / (0.67 * 0.67), 0, {}},
                  {"split", "1", 0.0, 0, {}},  {"R_R", "ohm", 8.6, 0, {}},
                  {"l_s", "H", 0.03, 0, {}},   {"l_r", "H", 0.03, 0, {}},
                  {"J", "kg*m^2", 0.01, 0, {}}};
  r.curve_wb = {0.5, 1.0, 1.5};
  for (const double flux_wb : r.curve_wb)
    r.parameters.push_back(
        {curve_name(flux_wb), "A", flux_wb / 0.64 * (1.0 + std::pow(flux_wb / 1.6, 4.0)), 0, {}});
  r.excitation.sufficient = true;
  return r;
}

// Between two points of the file the bench draws a line, which is off by 0.1 % at most. Catches: points that
// do not begin at zero, flux and current exchanged, a polynomial of the flux in the place of its square, an M
// that is not that of the T circuit.
TEST(IdentificationResult, TheBenchReadsTheCurveOfAMotorFile) {
  const BenchConfig bench = bench_of(saturated_result(), {.pole_pairs = 2});
  const auto& machine = std::get<SaturatedInductionMachineParameters>(bench.setup.axes[0].parameters.machine);
  EXPECT_EQ(machine.stator_leakage_h, 0.03);
  EXPECT_EQ(machine.rotor_resistance_ohm, 8.6);
  EXPECT_EQ(machine.magnetising_curve.points().size(), 101U);
  for (const double flux_wb : {0.1, 0.777, 1.25, 1.49}) {
    const double current_a = flux_wb / 0.64 * (1.0 + std::pow(flux_wb / 1.6, 4.0));
    EXPECT_NEAR(machine.magnetising_curve.inverse(flux_wb), current_a, 1e-3 * current_a);
  }
  const nlohmann::json json = nlohmann::json::parse(to_json(saturated_result()));
  EXPECT_EQ(json["magnetising_curve"][1]["flux_wb"], 1.0);
}

// Catches: a motor file that the bench refuses, because its curve falls.
TEST(IdentificationResult, ACurveThatFallsIsNoMotor) {
  Result r = saturated_result();
  r.find(curve_name(1.5))->value = 0.5;
  EXPECT_THROW(to_motor_toml(r, {}), IdentificationError);
}

}  // namespace
}  // namespace drivebench::identification::result_test
