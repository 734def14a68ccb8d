#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "tests/book/book_bench.hpp"
#include "tests/book/machines/transformer_circuit.hpp"
#include "tests/clients/identification/bench_data.hpp"

namespace drivebench::transformer_test {
namespace {

using Complex = std::complex<double>;

/// The motor im-b of the bench, as its file has it.
constexpr InductionMotorModel kMotorB = {.machine = {.pole_pairs = 3.0,
                                                     .mutual_inductance_h = 0.225,
                                                     .rotor_resistance_ohm = 2.1,
                                                     .rotor_inductance_h = 0.244,
                                                     .friction_nms = 0.0,
                                                     .inertia_kgm2 = 0.0185},
                                         .stator_resistance_ohm = 1.85,
                                         .stator_inductance_h = 0.244};

BenchConfig transformer_bench() {
  return identification::bench_config("im-b-transformer");
}

/// The current of phase a against the source's phase, rms: its space vector over e^(jωt), with the
/// power-invariant factor of three phases taken out.
Complex current_phasor(const BookBench& run) {
  const Sample& s = run.sample();
  const double omega = 2.0 * std::numbers::pi * 60.0;
  const Complex vector((2.0 * s.true_i_a_a - s.true_i_b_a - s.true_i_c_a) / 3.0,
                       (s.true_i_b_a - s.true_i_c_a) / std::numbers::sqrt3);
  return vector * std::polar(1.0, -omega * run.now_s()) / std::numbers::sqrt2;
}

/// After a minute nothing is left of the direct flux that energising the cores at tick 0 has given them,
/// which decays with 0.23/s. 3e-4 are the meter's window over ticks of 100 us.
constexpr double kSettled_s = 60.0;

void expect_steady(const BookBench& run, const TransformerCircuit& circuit, double slip) {
  const InductionCircuit::Point p = circuit.motor.at(slip);
  const Sample& seen = run.sample();
  const double terminal_v = std::abs(p.terminal_v);
  EXPECT_NEAR(seen.meter_u_rms_v, terminal_v, 3e-4 * terminal_v);
  EXPECT_NEAR(seen.meter_i_rms_a, std::abs(p.stator_a), 3e-4 * std::abs(p.stator_a));
  EXPECT_NEAR(seen.meter_p_w, p.active_w - p.line_loss_w, 3e-4 * p.active_w);
  EXPECT_NEAR(seen.torque_nm, p.torque_nm, 3e-4 * p.torque_nm);
  const Complex expected = p.stator_a * std::polar(1.0, std::arg(circuit.open_v));
  EXPECT_NEAR(std::abs(current_phasor(run) / expected - 1.0), 0.0, 3e-4);
}

// GRID-01, the bench im-b-transformer: under 5 N m the speed, the current with its phase, the droop of the
// terminal voltage and the power are those of the equivalent circuit behind Thévenin's impedance. Catches: a
// transformer whose impedance the machine or the power analyser does not see, a phase shift with the wrong
// sign.
TEST(BookTransformer, ARunningMotorHasTheVoltageThatTheCircuitLeavesIt) {
  const BenchConfig config = transformer_bench();
  BookBench run(config);
  run.run_until(kSettled_s);
  const TransformerCircuit circuit = transformer_circuit(config.setup.axes[0].parameters, kMotorB);
  const double slip = *circuit.motor.slip_under(5.0);
  EXPECT_NEAR(run.sample().speed_rad_s, circuit.motor.at(slip).speed_rad_s, 1e-4 * 120.0);
  expect_steady(run, circuit, slip);
}

// The same with the rotor held, where the droop is largest. Catches: a droop that only one of R and L gives.
TEST(BookTransformer, ALockedMotorDroopsAsTheCircuitSays) {
  BenchConfig config = transformer_bench();
  config.axes[0].events.clear();
  config.setup.axes[0].parameters.mechanics.motion = ShaftMotion::kLocked;
  BookBench run(config);
  run.run_until(kSettled_s);
  const TransformerCircuit circuit = transformer_circuit(config.setup.axes[0].parameters, kMotorB);
  EXPECT_LT(std::abs(circuit.motor.at(1.0).terminal_v), 0.96 * std::abs(circuit.open_v));
  expect_steady(run, circuit, 1.0);
}

// Catches: a flux that is not part of the saved state.
TEST(BookTransformer, ASavedStateGoesOnBitForBit) {
  BookBench run(transformer_bench());
  run.run_until(0.123);
  const std::vector<std::byte> saved = run.bench().save();
  run.run_until(0.2);
  BookBench again(transformer_bench());
  ASSERT_TRUE(again.bench().restore(saved));
  again.run_until(0.2);
  EXPECT_EQ(again.bench().state_hash(), run.bench().state_hash());
  EXPECT_EQ(again.sample().true_i_a_a, run.sample().true_i_a_a);
}

}  // namespace
}  // namespace drivebench::transformer_test
