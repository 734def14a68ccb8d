// The servo motor of the book started on the line, and the form of the model that can be identified from the
// terminals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

#include "plant/axis.hpp"
#include "plant/parameters/parameters.hpp"
#include "server/config/config.hpp"
#include "tests/plant/servo_axis.hpp"

namespace drivebench::induction_model_test {
namespace {

// Ticks of one integration step, so that the held voltage is as close to the sine as the reference.
constexpr double kStep_s = 25e-6;
constexpr double kLine_rad_s = 377.0;  // 60 Hz, as the book rounds it

PhaseCommand line_voltage(Tick tick, double peak_v) {
  const double angle_rad = kLine_rad_s * kStep_s * (static_cast<double>(tick) + 0.5);
  return {.gates = Gates::kVoltage,
          .setpoint = {.a = peak_v * std::cos(angle_rad), .b = peak_v * std::sin(angle_rad)}};
}

// These tests do not read the files. Catches: a servo bench for one of the transports with another motor,
// amplifier or sensor than the tested one.
TEST(BookInductionModel, EveryServoBenchHasTheMotorOfTheseTests) {
  AxisParameters tested = servo_axis();
  tested.drive.amplifier = {.voltage_limit_v = 80.0, .over_current_a = 6.0, .over_current_trip = false};
  for (const char* bench : {"servo", "servo-realtime", "servo-can", "servo-can-realtime", "servo-modbus"}) {
    const BenchConfig config = load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + bench + ".toml");
    const AxisParameters& shipped = config.setup.axes.at(0).parameters;
    ASSERT_EQ(shipped.machine.index(), tested.machine.index()) << bench;
    for (const Parameter& row : axis_parameters(tested))
      EXPECT_EQ(row.get(shipped), row.get(tested)) << bench << " " << row.name;
  }
}

// IMO-07 of the reference: 80 V (two-phase amplitude), 60 Hz, no load. The tolerances are half a unit of the
// last digit given, but 0.1 rad/s for the final speed. Catches: a wrong pole-pair number, mutual inductance,
// inertia or friction in any place of the model.
TEST(BookInductionModel, LineStartReachesTheSpeedFluxAndCurrentsOfTheReference) {
  Axis axis(servo_axis(), {.period_s = kStep_s, .substeps = 1}, 1, 0);
  double peak_speed_rad_s = 0.0;
  double peak_current_a = 0.0;
  double ninety_percent_s = 0.0;
  for (Tick tick = 0; tick < 40'000; ++tick) {
    axis.advance(line_voltage(tick, 80.0), tick);
    const Sample s = axis.sample(tick + 1);
    peak_speed_rad_s = std::max(peak_speed_rad_s, s.speed_rad_s);
    peak_current_a = std::max({peak_current_a, std::abs(s.true_i_a_a), std::abs(s.true_i_b_a)});
    if (ninety_percent_s == 0.0 && s.speed_rad_s > 0.9 * 125.40) {
      ninety_percent_s = static_cast<double>(tick + 1) * kStep_s;
    }
  }
  const Sample s = axis.sample(40'000);
  EXPECT_NEAR(s.speed_rad_s, 125.40, 0.1);
  EXPECT_NEAR(peak_speed_rad_s, 137.4, 0.05);
  EXPECT_NEAR(peak_current_a, 20.7, 0.05);
  EXPECT_NEAR(std::hypot(s.psi_a_wb, s.psi_b_wb), 0.1687, 5e-5);
  EXPECT_NEAR(std::hypot(s.true_i_a_a, s.true_i_b_a), 14.42, 0.01);
  EXPECT_NEAR(ninety_percent_s, 12.8e-3, 0.05e-3);
  EXPECT_NEAR(s.torque_nm, kServoFriction_nms * s.speed_rad_s, 1e-4);  // the last of the slow settling
  EXPECT_EQ(s.faults, 0u);
}

// Catches: a phase order that only changes the direction.
TEST(BookInductionModel, ExchangedPhasesTurnTheMotorBackwards) {
  Axis axis(servo_axis(), {.period_s = kStep_s, .substeps = 1}, 1, 0);
  for (Tick tick = 0; tick < 20'000; ++tick) {
    PhaseCommand command = line_voltage(tick, 80.0);
    std::swap(command.setpoint.a, command.setpoint.b);
    axis.advance(command, tick);
  }
  EXPECT_NEAR(axis.sample(20'000).speed_rad_s, -125.40, 0.2);
  EXPECT_LT(axis.sample(20'000).encoder_count, -10'000);
}

// IM-05: (M, L_R, R_R) -> (k M, k^2 L_R, k^2 R_R) is the same machine at its terminals, its flux k times as
// large. Catches: an equation in which one of the three is missing or stands alone.
TEST(BookInductionModel, MachinesWithScaledRotorsAreIndistinguishableAtTheTerminals) {
  constexpr double kScale = 1.37;
  AxisParameters scaled = servo_axis();
  auto& machine = std::get<InductionMachineParameters>(scaled.machine);
  machine.mutual_inductance_h *= kScale;
  machine.rotor_inductance_h *= kScale * kScale;
  machine.rotor_resistance_ohm *= kScale * kScale;
  Axis original(servo_axis(), kServoTiming, 1, 0);
  Axis twin(scaled, kServoTiming, 1, 0);
  for (Tick tick = 0; tick < 4'000; ++tick) {
    const PhaseCommand command = line_voltage(5 * tick, 60.0);
    original.advance(command, tick);
    twin.advance(command, tick);
    const Sample a = original.sample(tick + 1);
    const Sample b = twin.sample(tick + 1);
    ASSERT_NEAR(a.true_i_a_a, b.true_i_a_a, 1e-9);
    ASSERT_NEAR(a.true_i_b_a, b.true_i_b_a, 1e-9);
    ASSERT_NEAR(a.speed_rad_s, b.speed_rad_s, 1e-9 * 125.0);
    ASSERT_NEAR(a.psi_a_wb * kScale, b.psi_a_wb, 1e-11);
  }
  EXPECT_GT(original.sample(4'000).speed_rad_s, 100.0);
}

}  // namespace
}  // namespace drivebench::induction_model_test
