#include "clients/control/dc/dc_nested_loops.hpp"

#include <span>
#include <string>
#include <vector>

namespace drivebench::control {

std::vector<std::string> DcNestedLoopsParameters::problems() const {
  std::vector<std::string> found = dc_problems(*this);
  const double k = axis.machine.acceleration_per_a();
  const double speed_p = loops.speed_proportional_as_per_rad;
  const double speed_i = loops.speed_integral_a_per_rad;
  const double angle_p = loops.angle_proportional_per_s;
  const double angle_i = loops.angle_integral_per_s2;
  const Polynomial<4> loop = {axis.machine.friction_rate_per_s() + speed_p * k,
                              k * (speed_i + speed_p * angle_p), k * (speed_p * angle_i + speed_i * angle_p),
                              k * speed_i * angle_i};
  // An integral that is not there has no root.
  const std::size_t order = 2U + (angle_i != 0.0 ? 1U : 0U) + (speed_i != 0.0 ? 1U : 0U);
  if (found.empty() && !is_hurwitz(std::span(loop).first(order)))
    found.emplace_back("angle.integral_per_s2 and the gains beside it make the loops unstable");
  return found;
}

double DcNestedLoops::wanted(const Reference& r, const ShaftEstimate& shaft, double) noexcept {
  angle_error_rad_ = r.angle_rad - shaft.angle_rad;
  const double speed_rad_s = gains_.angle_proportional_per_s * angle_error_rad_ +
                             gains_.angle_integral_per_s2 * angle_integral_rad_s_;
  speed_error_rad_s_ = speed_rad_s - shaft.speed_rad_s;
  return gains_.speed_proportional_as_per_rad * speed_error_rad_s_ +
         gains_.speed_integral_a_per_rad * speed_integral_rad_;
}

void DcNestedLoops::integrate(double excess) noexcept {
  angle_integral_rad_s_ = integrated(angle_integral_rad_s_, angle_error_rad_, excess);
  speed_integral_rad_ = integrated(speed_integral_rad_, speed_error_rad_s_, excess);
}

}  // namespace drivebench::control
