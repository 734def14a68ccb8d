#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string_view>
#include <vector>

#include "clients/identification/data/settings.hpp"

/// Motors drawn at random and the experiment that each of them goes through.
namespace drivebench::identification {

/// The range that a parameter is drawn from: evenly in its logarithm, or in itself if it may be zero; four
/// digits.
struct Range {
  std::string_view name;
  std::string_view unit;
  double low;
  double high;
};

/// What the iron of a motor has beyond the plain model of its kind.
enum class Iron : std::uint8_t { kPlain, kSalient, kSaturated };

/// A kind of motor and the experiment with it.
struct MotorDraw {
  MotorKind kind;
  std::string_view name;
  std::string_view bench;       ///< of configs/benches, whose motor stands in the middle of the ranges
  std::string_view experiment;  ///< for people
  std::span<const Range> identified;
  std::span<const Range> others;     ///< parameters that the experiment does not identify
  double longest_s;                  ///< induction: the record ends here, whether the motor has run up or not
  Iron iron = Iron::kPlain;          ///< salient: L_d and L_q of a PM rotor; saturated: a magnetising curve
  std::span<const Range> derived{};  ///< what the experiment identifies as well, and no range has
  bool converts_voltages = true;     ///< false: the voltages of induction and PM motors are exact

  /// The identified parameters, then the derived ones.
  std::vector<Range> rows() const;
};

/// DC, induction, PM synchronous round and, after brushless DC, salient; last the same induction motors with
/// records of 0.2 s.
std::span<const MotorDraw> motor_draws() noexcept;

/// The induction motors of the table with iron that saturates, from a curve that bends below the flux of the
/// start to one that hardly bends at it. L_S, T_R and sigma are those without flux. Derived are the currents
/// of the points of the curve. Motors that are stated as straight count as not stated.
const MotorDraw& saturated_draw() noexcept;

/// Motor `number` of a kind, from 1 on, always the same: first the identified parameters, then the others.
std::vector<double> draw_motor(const MotorDraw& draw, int number);

/// A motor of a kind from an engine, in the same order.
std::vector<double> draw_motor(const MotorDraw& draw, std::mt19937_64& engine);

/// One parameter of one motor.
struct Finding {
  double truth;
  double by_equations = 0.0;  ///< the book's least squares
  double index = 0.0;
  double estimate = 0.0;  ///< refined
  double interval = 0.0;  ///< half of the 95 % interval
  bool stated = false;    ///< the verdict does not name it

  double error() const noexcept { return (estimate - truth) / truth; }
  double error_by_equations() const noexcept { return (by_equations - truth) / truth; }
  bool covered() const noexcept;
  bool covered_by_index() const noexcept;
};

/// The data of an experiment and the settings to identify the motor with.
struct Recorded {
  MeasuredData data;
  Settings how;
};

/// The experiment on such a motor, on the product's bench with a noise of this number.
Recorded record_motor(const MotorDraw& draw, int number, int noise);

/// The experiment on a motor with these parameters, on a bench with this seed.
Recorded record_motor(const MotorDraw& draw, const std::vector<double>& motor, std::uint64_t seed);

/// The findings of a result, one for each of draw.rows().
std::vector<Finding> findings_of(const MotorDraw& draw, const std::vector<double>& motor,
                                 const Result& result);

/// The same with its identification. Data that identify() refuses
/// state nothing. May run on many threads at once.
std::vector<Finding> identify_motor(const MotorDraw& draw, int number, int noise);

}  // namespace drivebench::identification
