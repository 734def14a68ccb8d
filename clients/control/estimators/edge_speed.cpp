#include "clients/control/estimators/edge_speed.hpp"

#include <algorithm>
#include <numbers>

namespace drivebench::control {

EdgeSpeed::EdgeSpeed(double counts_per_revolution, double period_s) noexcept
    : rad_per_count_(2.0 * std::numbers::pi / counts_per_revolution), period_s_(period_s) {}

double EdgeSpeed::step(std::int64_t count, double edge_age_s, std::int64_t periods) noexcept {
  const double passed_s = period_s_ * static_cast<double>(std::max<std::int64_t>(periods, 1));
  const std::int64_t moved = started_ ? count - count_ : 0;
  started_ = true;
  count_ = count;
  if (moved == 0) {
    edge_age_s_ += passed_s;
    const double most_rad_s = edge_age_s_ > 0.0 ? rad_per_count_ / edge_age_s_ : 0.0;
    return speed_rad_s_ = std::clamp(speed_rad_s_, -most_rad_s, most_rad_s);
  }
  // A count reached from below begins at its edge, one reached from above ends there.
  const std::int64_t edge_count = moved > 0 ? count : count + 1;
  const double between_s = edge_age_s_ + passed_s - edge_age_s;
  if (has_edge_ && between_s > 0.0) {
    speed_rad_s_ = rad_per_count_ * static_cast<double>(edge_count - edge_count_) / between_s;
  } else {
    speed_rad_s_ = 0.0;
  }
  has_edge_ = true;
  edge_count_ = edge_count;
  edge_age_s_ = edge_age_s;
  return speed_rad_s_;
}

}  // namespace drivebench::control
