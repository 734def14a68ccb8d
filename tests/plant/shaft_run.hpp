#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "plant/math/rk4.hpp"
#include "plant/mechanics/shaft.hpp"

namespace drivebench {

/// A shaft of either kind without a machine: Runge-Kutta steps that are cut at events, as in the drive train,
/// with an audit of the energy. Torques are constant within a step.
template <class State>
class ShaftRun {
 public:
  explicit ShaftRun(const MechanicsParameters& p, const State& start = {})
      : c_(constants_of(p)), x_{.shaft = start} {}

  void step(double duration_s, double torque_nm, double load_nm) {
    constexpr int kMaxEvents = 12;
    torque_nm_ = torque_nm;
    load_nm_ = load_nm;
    Freed freed;
    for (int n = 0; duration_s > 0.0 && n < kMaxEvents; ++n) {
      x_.shaft = locked(c_, x_.shaft, blocked);
      branch_ = branch_of(c_, x_.shaft, torque_nm, load_nm, blocked, false, freed);
      const Audited from = x_;
      const auto after = [&](double s) {
        return rk4_step(from, s, [&](const Audited& x) { return slope(x, torque_nm, load_nm); });
      };
      x_ = after(duration_s);
      const Crossing crossing = first_crossing(from.shaft, x_.shaft);
      if (crossing.event < 0) return;
      const double fraction =
          located(from.shaft, crossing, [&](double s) { return after(s * duration_s).shaft; });
      x_ = after(fraction * duration_s);
      x_.shaft = settled(c_, x_.shaft, crossing.event);
      freed = freed_by(branch_, crossing.event);
      duration_s *= 1.0 - fraction;
      ++events_;
    }
  }

  void run(double duration_s, int steps, double torque_nm, double load_nm) {
    for (int k = 0; k < steps; ++k)
      step(duration_s / steps, torque_nm, load_nm);
  }

  const State& x() const { return x_.shaft; }
  const ShaftConstants& constants() const { return c_; }
  const ShaftBranch& branch() const { return branch_; }  ///< of the last piece
  int events() const { return events_; }
  double supplied_j() const { return x_.supplied_j; }  ///< by machine and active load
  double lost_j() const { return x_.lost_j; }

  bool blocked = false;

 private:
  struct Audited {
    State shaft{};
    double supplied_j = 0.0;
    double lost_j = 0.0;
  };
  struct Crossing {
    int event = -1;
    double fraction = 1.0;
  };

  Audited slope(const Audited& x, double torque_nm, double load_nm) const {
    return {.shaft = derivative(c_, x.shaft, torque_nm, load_nm, branch_),
            .supplied_j = torque_nm * x.shaft.speed_rad_s - load_nm * load_side(c_, x.shaft, 0.0).speed_rad_s,
            .lost_j = losses_w(c_, x.shaft, branch_)};
  }

  double value(const State& x, int event) const {
    std::array<double, 4> values{};
    event_values(c_, x, branch_, torque_nm_, load_nm_, values);
    return values[static_cast<std::size_t>(event)];
  }

  Crossing first_crossing(const State& from, const State& to) const {
    std::array<double, 4> unused{};
    const int count = event_values(c_, from, branch_, torque_nm_, load_nm_, unused);
    Crossing first;
    for (int k = 0; k < count; ++k) {
      const double before = value(from, k);
      const double past = value(to, k);
      if (before * past < 0.0 && before / (before - past) < first.fraction) {
        first = {.event = k, .fraction = before / (before - past)};
      }
    }
    return first;
  }

  /// The part of the piece after which the event happens, to the last digit: bisection from the linear guess
  /// on.
  template <class After>
  double located(const State& from, const Crossing& crossing, const After& after) const {
    const double start = value(from, crossing.event);
    double low = 0.0;
    double high = 1.0;
    double guess = crossing.fraction;
    for (int k = 0; k < 60; ++k) {
      (value(after(guess), crossing.event) * start > 0.0 ? low : high) = guess;
      guess = 0.5 * (low + high);
    }
    return guess;
  }

  ShaftConstants c_;
  double torque_nm_ = 0.0;  // of the present step, as is the load
  double load_nm_ = 0.0;
  Audited x_;
  ShaftBranch branch_{};
  int events_ = 0;
};

}  // namespace drivebench
