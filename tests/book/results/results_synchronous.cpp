#include <algorithm>
#include <cmath>
#include <numbers>

#include "clients/control/synchronous/optimum_torque_pm.hpp"
#include "tests/book/closed_loop.hpp"
#include "tests/book/results/results.hpp"
#include "tests/clients/control/synchronous/pm_transitions.hpp"

namespace drivebench {
namespace {

constexpr double kStep_rad = std::numbers::pi / 100.0;  // 1.8 degrees

constexpr PmMachineModel kBm500 = {.pole_pairs = 4.0,
                                   .resistance_ohm = 0.25,
                                   .inductance_h = 1.4e-3,
                                   .torque_constant_nm_per_a = 0.162,
                                   .friction_nms = 0.0,
                                   .inertia_kgm2 = 1.39e-4,
                                   .star = true};
constexpr double kBm500_v = 124.75;  // 100 V rms between phases, as a two-phase amplitude

std::vector<Measured> move_of(const Outcome& seen) {
  return {counts("peak error", seen.peak_error_counts),
          counts("final error of the encoder", seen.final_encoder_error_counts),
          number("peak speed", seen.peak_speed_rad_s, "rad/s"),
          {"peak phase current", seen.peak_current_a, "A", 0.7}};
}

std::vector<Measured> radians_of(const Outcome& seen) {
  return {{"peak error", seen.peak_error_rad, "rad", 0.05 * seen.peak_error_rad + 2e-3},
          number("peak speed", seen.peak_speed_rad_s, "rad/s"),
          {"peak phase current", seen.peak_current_a, "A", 0.05 * seen.peak_current_a + 0.02}};
}

Measured failing_error(const char* preset, const ClosedLoopOptions& options = {}) {
  return failing("peak error", closed_loop(preset, options).peak_error_counts, "counts");
}

Measured steps_made(const char* preset, double step_rad) {
  return {"steps made", closed_loop(preset).rows.back().angle_rad / step_rad, "", 0.02};
}

/// The times at which 1000 rad/s are reached, and at which 10 are left.
std::vector<Measured> run_up(const char* preset) {
  double up_s = 0.0;
  double down_s = 0.0;
  for (const ClosedLoopRow& row : closed_loop(preset).rows) {
    const double speed_rad_s = row.sample.speed_rad_s;
    if (up_s == 0.0 && speed_rad_s >= 1000.0) up_s = row.time_s;
    if (up_s > 0.0 && down_s == 0.0 && speed_rad_s <= 10.0) down_s = row.time_s;
  }
  return {number("up after", 1e3 * up_s, "ms"), number("down after", 1e3 * down_s, "ms")};
}

/// The largest errors of both motors on one amplifier, away from the determinant 0 and on the way through it.
std::vector<Measured> two_motors() {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  const Outcome seen = closed_loop("exercise/9.9");
  const std::size_t second = seen.column("second_error_rad");
  const std::size_t determinant = seen.column("determinant");
  double apart_deg = 0.0;
  double through_deg = 0.0;
  double least = 1.0;
  for (const ClosedLoopRow& row : seen.rows) {
    if (row.time_s < 0.0) continue;
    const double error_deg = kDegrees * std::max(std::abs(row.error_rad), std::abs(row.telemetry[second]));
    double& most_deg = row.time_s >= 0.6 && row.time_s < 0.75 ? through_deg : apart_deg;
    most_deg = std::max(most_deg, error_deg);
    least = std::min(least, std::abs(row.telemetry[determinant]));
  }
  return {{"error", apart_deg, "degrees", 0.01},
          {"error on the way", through_deg, "degrees", 0.2},
          {"least determinant", least, "", 0.02},
          {"amplifier", seen.peak_of("amplifier_current_a"), "A", 0.6}};
}

std::vector<Measured> transitions(double current_a) {
  const control::PmTransitions t =
      control::transition_speeds(kBm500, {.voltage_v = kBm500_v, .current_a = current_a});
  std::vector<Measured> measured = {number("", t.first_motoring_rad_s, "rad/s"),
                                    number("", t.first_braking_rad_s, "rad/s")};
  for (const double w : t.second_motoring_rad_s)
    measured.push_back(number("", w, "rad/s"));
  for (const double w : t.second_braking_rad_s)
    measured.push_back(number("", w, "rad/s"));
  return measured;
}

Measured torque(double current_a, double speed_rad_s, double direction) {
  const auto best = control::optimum_torque(kBm500, {kBm500_v, current_a}, speed_rad_s, direction);
  return number("", best.value().torque_nm, "N m");
}

/// Overshoot, its time and the late frequency of the response to one step of current.
std::vector<Measured> current_step() {
  const Outcome seen = closed_loop("book/9.4-current");
  double peak_rad = 0.0;
  double peak_s = 0.0;
  std::vector<double> upward_s;
  for (std::size_t k = 1; k < seen.rows.size(); ++k) {
    const ClosedLoopRow& row = seen.rows[k];
    const ClosedLoopRow& last = seen.rows[k - 1];
    if (row.angle_rad > peak_rad) {
      peak_rad = row.angle_rad;
      peak_s = row.time_s;
    }
    if (last.angle_rad < kStep_rad && row.angle_rad >= kStep_rad) {
      const double part = (kStep_rad - last.angle_rad) / (row.angle_rad - last.angle_rad);
      upward_s.push_back(last.time_s + part * (row.time_s - last.time_s));
    }
  }
  return {number("peak", peak_rad / kStep_rad * 1.8, "degrees"), number("at", 1e3 * peak_s, "ms"),
          number("late", 5.0 / (upward_s.at(35) - upward_s.at(30)), "Hz")};
}

}  // namespace

ResultSection pm_results() {
  return {"Permanent-magnet synchronous machines (chapter 9)",
          {{"26", "1.8 mm (900 counts) in 30 ms, printed gains, `book/9.1.4`",
            "within 1 count afterwards; simulated 1.69 counts", move_of(closed_loop("book/9.1.4")), "agrees"},
           {"26", "the same with k11 and k22 exchanged, `book/9.1.4-swapped`",
            "nothing; its printed poles need them so; simulated 2.13 counts",
            move_of(closed_loop("book/9.1.4-swapped")),
            "both hold; the print has them exchanged either in the gains or in the poles"},
           {"26", "the same with the speed by backward difference, `book/9.1.4-backward-difference`",
            "the motor did not track", move_of(closed_loop("book/9.1.4-backward-difference")),
            "not reproduced: with exact timing it tracks, at the price of more clipped samples"},
           {"27",
            "the same with a sample of delay",
            "nothing; simulated 453 counts",
            {failing_error("book/9.1.4", {.command_delay_ticks = 1})},
            "control is lost: a sample is 40 electrical degrees"},
           {"28",
            "3000 rpm at 10 kHz with reduced gains, centred encoder and half a sample of lead, "
            "`book/9.7-3000rpm`",
            "a figure; simulated 6.4 counts", move_of(closed_loop("book/9.7-3000rpm")),
            "the printed gains make a current loop that 10 kHz cannot sample"},
           {"28",
            "the same with an encoder that rounds down; without the lead",
            "nothing; simulated 7400, 16000 counts",
            {failing_error("book/9.7-3000rpm-floor"), failing_error("book/9.7-3000rpm-no-lead")},
            "3000 rpm are 90 electrical degrees a sample"},
           {"28", "printed gains at 20 kHz, `book/9.7-3000rpm-20khz`", "nothing; simulated 0.72 counts",
            move_of(closed_loop("book/9.7-3000rpm-20khz")), "agrees"},
           {"29", "speeds at which the deciding limit changes, 22.05 A", "592, 635 rad/s", transitions(22.05),
            "the print lacks R²I²"},
           {"29", "the same for 67.36 A", "288, 320.6; 340.8, 383 rad/s", transitions(67.36),
            "the print lacks R²I²"},
           {"30",
            "torque at 22 A: 800 and 1000 rad/s, motoring and braking",
            "a figure; derived 3.130, −3.300, 2.610, −2.816 N m",
            {torque(22.0, 800.0, 1.0), torque(22.0, 800.0, -1.0), torque(22.0, 1000.0, 1.0),
             torque(22.0, 1000.0, -1.0)},
            "agrees with K_m = 0.162; the 0.243 that 9.2.3 lists does not fit its own figures"},
           {"30",
            "torque at 67.4 A and 400 rad/s, motoring and braking",
            "a figure; derived 8.453, −9.487 N m",
            {torque(67.4, 400.0, 1.0), torque(67.4, 400.0, -1.0)},
            "as above"},
           {"9.8", "run-up to 1000 rad/s and back with 22 A, `book/9.8-22a`",
            "about 40 ms; simulated 44.0, 84.3 ms", run_up("book/9.8-22a"),
            "the current needs time; without that 41.4 ms"},
           {"9.8", "the same with 67.4 A, `book/9.8-67a`", "nothing; simulated 23.5, 44.7 ms",
            run_up("book/9.8-67a"), "agrees"},
           {"ST-05", "two steppers on one amplifier, through the determinant 0, `exercise/9.9`",
            "no numbers; derived: the determinant is sin(n_p(θ₂ − θ₁))", two_motors(),
            "machines, gains and move are ours"}}};
}

ResultSection stepper_results() {
  return {"The stepper motor without a sensor (9.4, 9.10)",
          {{"33",
            "four full steps, eight half steps",
            "1.8° and 0.9° each",
            {steps_made("book/9.4-full", kStep_rad), steps_made("book/9.10-half", 0.5 * kStep_rad)},
            "agrees"},
           {"33", "response to a step of 1 A, `book/9.4-current`",
            "a ringing step; derived 3.46° at 7.96 ms, 73.0 Hz", current_step(), "agrees"},
           {"34",
            "40 steps at 200 and at 400 a second with 1.1 V",
            "nothing; simulated 40 and 4",
            {steps_made("stepper/train-200", kStep_rad), steps_made("stepper/train-400", kStep_rad)},
            "lost steps come in whole electrical turns"}}};
}

ResultSection other_synchronous_results() {
  const Outcome slow = closed_loop("book/10.6-200v");
  const Outcome weakened = closed_loop("wound-rotor/field-weakening");
  const Outcome constant = closed_loop("wound-rotor/constant-field");
  return {"Brushless DC and wound rotor (chapters 10 and 6)",
          {{"AC-29", "240 rad at 400 rad/s, six-step, 250 V, `book/10.6`",
            "no number; simulated 0.1223 rad, final below 1e-3 rad", radians_of(closed_loop("book/10.6")),
            "agrees"},
           {"AC-29", "the same commutated by Hall lines, `book/10.6-hall`", "as above",
            radians_of(closed_loop("book/10.6-hall")), "agrees"},
           {"AC-29",
            "the same with 200 V",
            "no number; derived: below 388.98 rad/s",
            {number("peak speed", slow.peak_speed_rad_s, "rad/s"),
             failing("peak error", slow.peak_error_rad, "rad")},
            "the emf leaves no voltage for the current"},
           {"BL-06", "350 rad/s behind a switched inverter with dead time, `book/10.6-inverter`",
            "no number; simulated 0.107 rad with 1000 V/A", radians_of(closed_loop("book/10.6-inverter")),
            "PI current loops in place of 1000 V/A"},
           {"SM", "wound rotor: servo move with a field of 1 A, `wound-rotor/servo`",
            "no number; gains and move ours", radians_of(closed_loop("wound-rotor/servo")),
            "nothing to compare with"},
           {"SM",
            "wound rotor: 350 rad/s with field weakening, and with a constant field",
            "no number; derived: 248.8 rad/s with a constant field",
            {number("weakened", weakened.peak_speed_rad_s, "rad/s"),
             number("constant", constant.peak_speed_rad_s, "rad/s")},
            "agrees"}}};
}

}  // namespace drivebench
