#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "tests/clients/identification/monte_carlo/random_motors.hpp"

/// How often the verdict of an identification is wrong.
namespace drivebench::identification {

/// The ways in which a record of a random motor is looked at.
enum class Look { kWhole, kPart, kWrongPolePairs };
inline constexpr std::array<std::string_view, 3> kLooks = {
    "the whole experiment", "a part of it drawn at random", "pole pairs one too many or too few"};

/// The verdict on one record.
struct VerdictFinding {
  bool applies = true;     ///< a DC motor has no pole pairs
  bool certified = false;  ///< every parameter stated
  bool right = false;      ///< every estimate within 5 % of the truth, friction and load within 30 %
  bool wrong = false;      ///< a stated parameter lies farther off than 5 % and than twice its interval
};

/// The verdict on motor `number` of a kind: with its first noise, and a part of its record between 3 and 50 %
/// of the whole that depends on the number alone.
VerdictFinding verdict_of(const MotorDraw& draw, int number, Look look);

/// The verdicts on `motors` motors of a kind in one look.
struct VerdictTrials {
  const MotorDraw* draw;
  Look look;
  std::vector<VerdictFinding> findings;
};
std::vector<VerdictTrials> run_verdicts(std::span<const MotorDraw> draws, int motors, int threads);

}  // namespace drivebench::identification
