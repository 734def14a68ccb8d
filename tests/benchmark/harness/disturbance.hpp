#pragma once

namespace drivebench::speed {

/// Beyond these a figure says more about the machine than about the program.
inline constexpr double kMaxGone = 0.03;
inline constexpr double kMaxSlowed = 0.05;

/// What others took from the CPUs around a measurement.
struct Disturbance {
  double gone = 0.0;    ///< share of the time (0..1)
  double slowed = 0.0;  ///< how much longer a fixed calculation took than at its best: 0.05 is 5 %

  bool spoils() const noexcept { return gone > kMaxGone || slowed > kMaxSlowed; }
};

}  // namespace drivebench::speed
