#pragma once

#include <bench.pb.h>

#include <cstdint>

#include "clients/link/common/requests.hpp"

namespace drivebench::web {

/// What an axis is to do open loop, in the unit of its gates: V, A, or the duty of a leg.
///
///   a = constant.a + U cos θ,  b and c lag by their angles,  f = constant.f
///   U = boost + per_hz · |f|,  dθ/dt = 2π f
struct OpenLoopTarget {
  v1::Gates gates = v1::GATES_OFF;  ///< off, voltage, current or duty
  link::Setpoints constant{};
  double boost = 0.0;   ///< amplitude of the rotating part at standstill
  double per_hz = 0.0;  ///< what each hertz adds to the amplitude
  double frequency_hz = 0.0;
  double ramp_s = 0.0;  ///< until the target is reached; 0: at once
};

/// Writes the set-points of a command that has its gates.
void put_setpoints(v1::Command& command, const link::Setpoints& x);

/// The terminals of an axis as its commands see them.
struct OpenLoopTerminals {
  std::uint32_t phases = 3;
  bool two_phase = false;  ///< b lags by 90 degrees; otherwise b and c by 120 and 240
  bool star = false;       ///< duties rest at a half
};

/// The commands of an axis that is driven open loop. Everything moves in a straight line from what is in
/// force to the target; after GATES_OFF the amplitude begins at the target's boost and the rest at zero.
class OpenLoop {
 public:
  OpenLoop(std::uint32_t axis, double period_s, const OpenLoopTerminals& terminals)
      : axis_(axis), period_s_(period_s), terminals_(terminals) {}

  void follow(const OpenLoopTarget& target);
  /// Towards standstill and no set-points, within the target's ramp or `longest_s`, whichever is shorter.
  void ramp_down(double longest_s);
  /// Gates off at once.
  void switch_off() noexcept { target_ = now_ = {}; }

  /// The command that answers the sample of a tick; ticks rise from call to call.
  v1::Command command(std::uint64_t tick);

  std::uint32_t axis() const noexcept { return axis_; }
  v1::Gates gates() const noexcept { return target_.gates; }
  double frequency_hz() const noexcept { return now_.frequency_hz; }
  double amplitude() const noexcept;  ///< of the rotating part
  bool has_arrived() const noexcept { return progress_ >= 1.0; }

 private:
  OpenLoopTarget at_rest(const OpenLoopTarget& target) const noexcept;
  void advance(double dt_s) noexcept;

  std::uint32_t axis_;
  double period_s_;
  OpenLoopTerminals terminals_;
  OpenLoopTarget target_{};
  OpenLoopTarget from_{};  // at the beginning of the ramp
  OpenLoopTarget now_{};
  double progress_ = 1.0;  // of the ramp, 0 to 1
  double angle_rad_ = 0.0;
  std::uint64_t tick_ = 0;
  bool has_tick_ = false;
};

}  // namespace drivebench::web
