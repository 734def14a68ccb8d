#include "clients/control/dc/dc_tachometer_loop.hpp"

#include <span>
#include <string>
#include <vector>

namespace drivebench::control {

std::vector<std::string> DcTachometerLoopParameters::problems() const {
  std::vector<std::string> found = dc_problems(*this);
  const double k = axis.machine.acceleration_per_a();
  const Polynomial<3> closed = {axis.machine.friction_rate_per_s() + loop.speed_as_per_rad * k,
                                loop.proportional_a_per_rad * k,
                                loop.zero_per_s * loop.proportional_a_per_rad * k};
  const std::size_t order = loop.zero_per_s == 0.0 ? 2 : 3;
  if (found.empty() && !is_hurwitz(std::span(closed).first(order))) {
    found.emplace_back("loop.zero_per_s makes the loop unstable: it must be below f/J + K_t K_T/J");
  }
  return found;
}

double DcTachometerLoop::wanted(const Reference& r, const ShaftEstimate& shaft, double) noexcept {
  error_rad_ = r.angle_rad - shaft.angle_rad;
  return gains_.proportional_a_per_rad * (error_rad_ + gains_.zero_per_s * error_integral_rad_s_) -
         gains_.speed_as_per_rad * shaft.speed_rad_s;
}

void DcTachometerLoop::integrate(double excess) noexcept {
  error_integral_rad_s_ = integrated(error_integral_rad_s_, error_rad_, excess);
}

}  // namespace drivebench::control
