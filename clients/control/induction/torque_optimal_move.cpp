#include "clients/control/induction/torque_optimal_move.hpp"

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace drivebench::control {
namespace {

/// One phase of the move from a speed on.
struct Phase {
  TorqueSign sign;
  double start_rad_s;
  double end_rad_s;
  double duration_s;
  double ramp_s;
};

double smooth_step(double x) noexcept {
  const double y = std::clamp(x, 0.0, 1.0);
  return y * y * (3.0 - 2.0 * y);
}

struct Shaft {
  double angle_rad;
  double speed_rad_s;
};

double acceleration_rad_s2(const Phase& phase, double share, const OptimumTorqueTable& optimum,
                           const InductionMachineModel& machine, double t_s, double speed_rad_s) noexcept {
  const double fade = smooth_step(t_s / phase.ramp_s) * smooth_step((phase.duration_s - t_s) / phase.ramp_s);
  const double torque_nm = share * fade * optimum.at(speed_rad_s, phase.sign).torque_nm;
  return (torque_nm - machine.friction_nms * speed_rad_s) / machine.inertia_kgm2;
}

/// The phase in steps of Runge-Kutta 4, shown one by one to the visitor: (t, angle, speed, acceleration).
template <class Visitor>
Shaft integrated(const Phase& phase, double share, const OptimumTorqueTable& optimum,
                 const InductionMachineModel& machine, Shaft x, int steps, Visitor visit) {
  const double h_s = phase.duration_s / steps;
  const auto alpha = [&](double t_s, double speed_rad_s) {
    return acceleration_rad_s2(phase, share, optimum, machine, t_s, speed_rad_s);
  };
  for (int k = 0; k < steps; ++k) {
    const double t_s = h_s * k;
    const double a1 = alpha(t_s, x.speed_rad_s);
    visit(x, a1);
    const double a2 = alpha(t_s + 0.5 * h_s, x.speed_rad_s + 0.5 * h_s * a1);
    const double a3 = alpha(t_s + 0.5 * h_s, x.speed_rad_s + 0.5 * h_s * a2);
    const double a4 = alpha(t_s + h_s, x.speed_rad_s + h_s * a3);
    x.angle_rad += h_s * (x.speed_rad_s + h_s / 6.0 * (a1 + a2 + a3));
    x.speed_rad_s += h_s / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
  }
  return x;
}

constexpr double kStepS = 0.5e-3;
constexpr double kLargestShare = 4.0;

int steps_of(const Phase& phase) noexcept {
  return std::clamp(static_cast<int>(phase.duration_s / kStepS), 1, 100'000);
}

/// The share of the optimum torque that ends the phase at its end speed.
double share_of(const Phase& phase, const OptimumTorqueTable& optimum, const InductionMachineModel& machine) {
  const double sign = phase.sign == TorqueSign::kMotoring ? 1.0 : -1.0;
  const auto overshoots = [&](double share) {
    const Shaft end = integrated(phase, share, optimum, machine, {0.0, phase.start_rad_s}, steps_of(phase),
                                 [](const Shaft&, double) {});
    return sign * (end.speed_rad_s - phase.end_rad_s) > 0.0;
  };
  if (!overshoots(kLargestShare) || overshoots(0.0)) {
    throw std::invalid_argument(phase.sign == TorqueSign::kMotoring
                                    ? "move.run_up_s does not fit move.top_speed_rad_s and the machine"
                                    : "move.run_down_s does not fit move.top_speed_rad_s and the machine");
  }
  double low = 0.0;
  double high = kLargestShare;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (overshoots(middle) ? high : low) = middle;
  }
  return high;
}

/// Between two points the quintic that has their angle, speed and acceleration.
Reference between(const Reference& a, const Reference& b, double h_s, double x) noexcept {
  const double dq = b.angle_rad - a.angle_rad - h_s * (a.speed_rad_s + 0.5 * h_s * a.acceleration_rad_s2);
  const double dv = h_s * (b.speed_rad_s - a.speed_rad_s - h_s * a.acceleration_rad_s2);
  const double da = h_s * h_s * (b.acceleration_rad_s2 - a.acceleration_rad_s2);
  const double c3 = 10.0 * dq - 4.0 * dv + 0.5 * da;
  const double c4 = -15.0 * dq + 7.0 * dv - da;
  const double c5 = 6.0 * dq - 3.0 * dv + 0.5 * da;
  const double u = x * h_s;
  const double x2 = x * x;
  return {.angle_rad = a.angle_rad + u * (a.speed_rad_s + 0.5 * u * a.acceleration_rad_s2) +
                       x * x2 * (c3 + x * (c4 + x * c5)),
          .speed_rad_s = a.speed_rad_s + u * a.acceleration_rad_s2 +
                         x2 * (3.0 * c3 + x * (4.0 * c4 + 5.0 * x * c5)) / h_s,
          .acceleration_rad_s2 =
              a.acceleration_rad_s2 + x * (6.0 * c3 + x * (12.0 * c4 + 20.0 * x * c5)) / (h_s * h_s),
          .jerk_rad_s3 = (6.0 * c3 + x * (24.0 * c4 + 60.0 * x * c5)) / (h_s * h_s * h_s)};
}

}  // namespace

std::vector<std::string> TorqueMoveParameters::problems() const {
  std::vector<std::string> found = range_problems(*this);
  if (2.0 * torque_ramp_s > std::min(run_up_s, run_down_s))
    found.emplace_back("move.torque_ramp_s must fit twice into either phase");
  return found;
}

TorqueOptimalMove::TorqueOptimalMove(const TorqueMoveParameters& p, const OptimumTorqueTable& optimum,
                                     const InductionMachineModel& machine)
    : parameters_(p) {
  const Phase up = {TorqueSign::kMotoring, 0.0, p.top_speed_rad_s, p.run_up_s, p.torque_ramp_s};
  const Phase down = {TorqueSign::kGenerating, p.top_speed_rad_s, 0.0, p.run_down_s, p.torque_ramp_s};
  motoring_share_ = share_of(up, optimum, machine);
  generating_share_ = share_of(down, optimum, machine);

  const auto record = [this](const Shaft& x, double alpha) {
    points_.push_back({.angle_rad = x.angle_rad, .speed_rad_s = x.speed_rad_s, .acceleration_rad_s2 = alpha});
  };
  const Shaft top = integrated(up, motoring_share_, optimum, machine, {0.0, 0.0}, steps_of(up), record);
  up_steps_ = points_.size();
  const Shaft end = integrated(down, generating_share_, optimum, machine, top, steps_of(down), record);
  points_.push_back({.angle_rad = end.angle_rad});
}

Reference TorqueOptimalMove::at(double t_s) const noexcept {
  if (t_s < 0.0) return {};
  if (t_s >= duration_s()) return points_.back();
  const bool up = t_s < parameters_.run_up_s;
  const std::size_t first = up ? 0 : up_steps_;
  const std::size_t steps = up ? up_steps_ : points_.size() - 1 - up_steps_;
  const double h_s = (up ? parameters_.run_up_s : parameters_.run_down_s) / static_cast<double>(steps);
  const double place = (up ? t_s : t_s - parameters_.run_up_s) / h_s;
  const auto below = std::min(static_cast<std::size_t>(place), steps - 1);
  return between(points_[first + below], points_[first + below + 1], h_s, place - static_cast<double>(below));
}

}  // namespace drivebench::control
