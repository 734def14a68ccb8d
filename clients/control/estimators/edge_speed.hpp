#pragma once

#include <cstdint>

namespace drivebench::control {

/// Speed from the times of the encoder's edges instead of from counts at sample times: the angle between the
/// last edge seen before and the newest one, over the time between them. Its error is that of the edge times,
/// not a whole count per period. Without a new edge the speed is at most one count over the age of the last
/// one, so that it goes to zero when the shaft stands. Crossing one edge to and fro is no way: the speed is
/// zero.
class EdgeSpeed {
 public:
  EdgeSpeed(double counts_per_revolution, double period_s) noexcept;

  /// The speed at this sample, from its count and the age of the newest edge; the first one gives 0.
  double step(std::int64_t count, double edge_age_s, std::int64_t periods) noexcept;

 private:
  double rad_per_count_;
  double period_s_;
  bool started_ = false;
  bool has_edge_ = false;  // an edge with a known place has been seen
  std::int64_t count_ = 0;
  double edge_age_s_ = 0.0;
  std::int64_t edge_count_ = 0;  // the angle of the edge, in counts
  double speed_rad_s_ = 0.0;
};

}  // namespace drivebench::control
