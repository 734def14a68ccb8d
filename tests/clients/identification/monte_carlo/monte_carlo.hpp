#pragma once

#include <span>
#include <string>
#include <vector>

#include "tests/clients/identification/monte_carlo/random_motors.hpp"
#include "tests/clients/identification/monte_carlo/verdicts.hpp"

/// The trials whose results tests/book/IDENTIFICATION.md holds.
namespace drivebench::identification {

struct MonteCarloPlan {
  int motors;   ///< of each kind
  int noises;   ///< experiments with each of them
  int threads;  ///< has no influence on the numbers
};

inline constexpr int kAllMotors = 200;
inline constexpr int kAllNoises = 3;
inline constexpr int kShownMotors = 5;
inline constexpr int kVerdictMotors = 40;  ///< of each kind

/// The experiments with one kind, by motor and noise.
struct Trials {
  const MotorDraw* draw;
  int noises;
  std::vector<std::vector<Finding>> findings;
};

/// Runs them all: trial k on thread k modulo their number.
std::vector<Trials> run_trials(std::span<const MotorDraw> draws, const MonteCarloPlan& plan);

/// Those of the table: motor_draws() by the plan, the motors of saturated_draw() once each.
std::vector<Trials> run_table(const MonteCarloPlan& plan);

/// The document. What it says of all motors needs kAllMotors, kAllNoises and kVerdictMotors.
std::string markdown_of(const std::vector<Trials>& trials, const std::vector<VerdictTrials>& verdicts);

/// The differences between a text and that of these trials, of at least kShownMotors, one sentence each.
/// Of the tables over all motors only names and ranges are compared; the motors that are shown one by one to
/// 2 % of each number and 0.002 points of a percentage: other C libraries round otherwise.
std::vector<std::string> differences(const std::string& text, const std::vector<Trials>& trials,
                                     const std::vector<VerdictTrials>& verdicts);

}  // namespace drivebench::identification
