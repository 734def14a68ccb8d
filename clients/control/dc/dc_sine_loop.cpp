#include "clients/control/dc/dc_sine_loop.hpp"

#include <string>
#include <vector>

namespace drivebench::control {

std::vector<std::string> DcSineLoopParameters::problems() const {
  std::vector<std::string> found = dc_problems(*this);
  const double friction = axis.machine.friction_rate_per_s();
  const double square = loop.angular_frequency_rad_s * loop.angular_frequency_rad_s;
  const double gain = loop.gain_a_s_per_rad * axis.machine.acceleration_per_a();
  if (found.empty() &&
      !is_hurwitz(Polynomial<4>{friction, square, friction * square + gain, gain * loop.zero_per_s})) {
    found.emplace_back("loop.gain_a_s_per_rad and the numbers beside it make the loop unstable");
  }
  return found;
}

DcSineLoop::DcSineLoop(const DcSineLoopParameters& p) noexcept
    : DcController(p.axis, Law::kCurrent), gains_(p.loop) {
  const double t_s = p.axis.period_s();
  const double square = p.loop.angular_frequency_rad_s * p.loop.angular_frequency_rad_s;
  over_period_ =
      matrix_exponential(Matrix<3, 3>{{{0.0, t_s, 0.0}, {-square * t_s, 0.0, t_s}, {0.0, 0.0, 0.0}}});
}

double DcSineLoop::wanted(const Reference& r, const ShaftEstimate& shaft, double) noexcept {
  error_rad_ = r.angle_rad - shaft.angle_rad;
  return gains_.gain_a_s_per_rad * (gains_.zero_per_s * x1_ + x2_);
}

void DcSineLoop::integrate(double excess) noexcept {
  // At its limit the oscillator swings on without being driven.
  const double drive = excess == 0.0 ? error_rad_ : 0.0;
  const Matrix<3, 1> next = product(over_period_, Matrix<3, 1>{{{x1_}, {x2_}, {drive}}});
  x1_ = next[0][0];
  x2_ = next[1][0];
}

}  // namespace drivebench::control
