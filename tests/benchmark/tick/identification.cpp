#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include "clients/identification/identify.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/clients/identification/monte_carlo/monte_carlo.hpp"

namespace drivebench::speed::identifications {
namespace {

using namespace identification;

constexpr std::size_t kRounds = 5;
constexpr int kStarts = 20;
constexpr double kMostMs = 100.0;
constexpr double kMostSeconds = 100.0;  // the table of three noises in 5 minutes

/// Starts of induction motors, 0.2 s at 20 kHz, from recorded signals to parameters: filters, regressor,
/// global search. The slowest of the motors counts.
Row start_row() {
  std::vector<Recorded> starts;
  for (int number = 1; number <= planned(kStarts, 1); ++number)
    starts.push_back(record_motor(motor_draws().back(), number, 1));
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] {
    double slowest_ms = 0.0;
    for (const Recorded& start : starts) {
      const std::int64_t begin = now_ns();
      const Result found = identify_by_equations(start.data, start.how);
      slowest_ms = std::max(slowest_ms, static_cast<double>(now_ns() - begin) * 1e-6);
      if (found.parameters.empty()) throw std::runtime_error("a start is not identified");
    }
    return slowest_ms;
  });
  return {.name = "identification of a start",
          .unit = "ms",
          .measured = percentile(rounds.results, 0.5),
          .limit = Limit{Limit::Kind::kAtMost, kMostMs},
          .disturbance = rounds.disturbance,
          .note = "slowest of 20 induction motors, 0.2 s at 20 kHz: filters, regressor, global search"};
}

/// Random motors of each kind from recorded signals to parameters with intervals. The slowest counts.
Row refinement_row() {
  constexpr int kMotors = 3;
  constexpr double kMostRefinedMs = 1000.0;
  std::vector<Recorded> records;
  for (const MotorDraw& draw : motor_draws().first(4)) {
    for (int number = 1; number <= planned(kMotors, 1); ++number)
      records.push_back(record_motor(draw, number, 1));
  }
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] {
    double slowest_ms = 0.0;
    for (const Recorded& record : records) {
      const std::int64_t begin = now_ns();
      const Result found = identify(record.data, record.how);
      slowest_ms = std::max(slowest_ms, static_cast<double>(now_ns() - begin) * 1e-6);
      if (!found.excitation.sufficient)
        throw std::runtime_error("a motor is refused: " + found.excitation.verdict);
    }
    return slowest_ms;
  });
  return {
      .name = "identification with intervals",
      .unit = "ms",
      .measured = percentile(rounds.results, 0.5),
      .limit = Limit{Limit::Kind::kAtMost, kMostRefinedMs},
      .disturbance = rounds.disturbance,
      .note = "slowest of 12 motors of four kinds, up to 20,000 samples: least squares, refinement, verdict"};
}

/// 200 motors of four kinds, experiments and identification, on two threads.
Row monte_carlo_row() {
  constexpr int kThreads = 2;
  const int motors = planned(kAllMotors, 2);
  const std::array cpus{cpu_pair().near, cpu_pair().far};
  Canary canary;
  canary.look(cpus);
  const std::int64_t begin = now_ns();
  const auto trials = run_trials(motor_draws().first(4), {motors, 1, kThreads});
  const double seconds = static_cast<double>(now_ns() - begin) * 1e-9;
  canary.look(cpus);
  for (const Trials& kind : trials) {
    const auto stated = std::ranges::count_if(
        kind.findings, [](const std::vector<Finding>& motor) { return motor.front().stated; });
    if (stated < motors * 9 / 10) throw std::runtime_error("too few motors are identified");
  }
  return {.name = "800 random motors",
          .unit = "s",
          .measured = seconds,
          .limit = Limit{Limit::Kind::kAtMost, kMostSeconds},
          .disturbance = canary.seen(),
          .note = "200 DC, induction, PM synchronous and brushless ones with their experiments, two threads"};
}

}  // namespace

std::vector<Row> measure() {
  return {start_row(), refinement_row(), monte_carlo_row()};
}

}  // namespace drivebench::speed::identifications
