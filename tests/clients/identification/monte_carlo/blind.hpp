#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/clients/identification/monte_carlo/random_motors.hpp"
#include "tests/clients/identification/wiring/crossed_wires.hpp"

/// Motors and wirings from a seed that the identification does not see.
namespace drivebench::identification {

inline constexpr int kBlindMotors = 10;  ///< of each kind

/// One motor: what the seed drew, and what the identification made of the columns of the record.
struct BlindMotor {
  const MotorDraw* draw = nullptr;
  CrossedWires wires{};
  bool pole_pairs = false;  ///< right, or a DC motor
  bool direction = false;
  bool shift = false;
  bool zero = false;  ///< within 3 electrical degrees, or a motor without a magnet
  bool certified = false;
  std::vector<Finding> findings{};

  bool wired() const noexcept { return pole_pairs && direction && shift && zero; }
};

/// Motor `number` of a kind: parameters, noise, direction and zero of the encoder and up to three samples of
/// delay of the voltages from the seed; the identification gets the columns, the kind, the counts of a turn,
/// and from when on the equations hold.
BlindMotor blind_motor(const MotorDraw& draw, std::uint64_t seed, int number);

/// DC, induction, PM, brushless, salient PM; `threads` has no influence on the numbers.
std::vector<BlindMotor> run_blind(std::uint64_t seed, int motors, int threads);

/// The score as Markdown.
std::string blind_markdown(std::uint64_t seed, const std::vector<BlindMotor>& motors);

}  // namespace drivebench::identification
