#pragma once

#include <optional>
#include <span>
#include <vector>

namespace drivebench::regression {

/// A frequency response at one line of a multisine.
struct ResponsePoint {
  double hz;
  double gain_db;
  double phase_deg;  ///< continuous from line to line; that of the first within -270 to 90
  double error;      ///< standard error of the response, relative to it
};

/// A line with a larger error is drawn, but nothing is read from it: 10 % are 0.9 dB and 5.7 degrees.
inline constexpr double kLargestResponseError = 0.1;

/// The lines that can be read.
std::vector<ResponsePoint> readable(std::span<const ResponsePoint> points);

/// Makes the phases continuous, over those that can be read.
void unwrap(std::span<ResponsePoint> points) noexcept;

/// A place between the lines, by cubics through the gain in decibels and the phase over the logarithm of the
/// frequency.
struct ResponseAt {
  double hz;
  double gain_db;
  double phase_deg;
};

/// Nothing outside the lines.
std::optional<ResponseAt> response_at(std::span<const ResponsePoint> points, double hz);

/// The margins of a closed loop with the gain L = C·P, in negative feedback.
struct LoopMargins {
  /// |L| = 1 with the least 180° + arg L; empty: no line crosses 0 dB.
  std::optional<ResponseAt> crossover{};
  double phase_margin_deg = 0.0;
  /// arg L = -180° with |L| nearest to 1; empty: no line crosses.
  std::optional<ResponseAt> reversal{};
  /// How much more gain the loop bears, or less if there |L| > 1 (a loop that is stable under conditions).
  double gain_margin_db = 0.0;
};

LoopMargins margins_of(std::span<const ResponsePoint> points);

}  // namespace drivebench::regression
