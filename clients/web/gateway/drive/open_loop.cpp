#include "clients/web/gateway/drive/open_loop.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plant/math/trig.hpp"

namespace drivebench::web {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

double blend(double from, double to, double progress) noexcept {
  return progress >= 1.0 ? to : from + progress * (to - from);
}

}  // namespace

void put_setpoints(v1::Command& command, const link::Setpoints& x) {
  if (command.gates() == v1::GATES_CURRENT) {
    command.set_i_a_a(x.a);
    command.set_i_b_a(x.b);
    command.set_i_c_a(x.c);
    command.set_i_f_a(x.f);
  } else if (command.gates() == v1::GATES_DUTY) {
    command.set_d_a(x.a);
    command.set_d_b(x.b);
    command.set_d_c(x.c);
    command.set_d_f(x.f);
  } else if (command.gates() == v1::GATES_VOLTAGE) {
    command.set_u_a_v(x.a);
    command.set_u_b_v(x.b);
    command.set_u_c_v(x.c);
    command.set_u_f_v(x.f);
  }
}

OpenLoopTarget OpenLoop::at_rest(const OpenLoopTarget& target) const noexcept {
  OpenLoopTarget rest = target;
  const double middle = target.gates == v1::GATES_DUTY && terminals_.star ? 0.5 : 0.0;
  rest.constant = {.a = middle, .b = middle, .c = middle, .f = 0.0};
  rest.frequency_hz = 0.0;
  return rest;
}

void OpenLoop::follow(const OpenLoopTarget& target) {
  if (target_.gates != target.gates) {  // what is in force has another unit
    now_ = at_rest(target);
    angle_rad_ = 0.0;
    has_tick_ = false;
  }
  target_ = target;
  from_ = now_;
  progress_ = target.ramp_s > 0.0 ? 0.0 : 1.0;
  if (progress_ >= 1.0) now_ = target;
}

void OpenLoop::ramp_down(double longest_s) {
  if (gates() == v1::GATES_OFF) return;
  OpenLoopTarget rest = at_rest(target_);
  rest.ramp_s = std::min(target_.ramp_s, longest_s);
  follow(rest);
}

v1::Command OpenLoop::command(std::uint64_t tick) {
  const bool has_gone_back = tick < tick_;  // the bench was reset or restored
  if (has_tick_ && !has_gone_back && gates() != v1::GATES_OFF)
    advance(static_cast<double>(tick - tick_) * period_s_);
  tick_ = tick;
  has_tick_ = true;
  const double lag_rad = terminals_.two_phase ? kTurn / 4.0 : kTurn / 3.0;
  const auto rotating = [&](std::uint32_t phase) {
    return phase < terminals_.phases ? amplitude() * cosine(angle_rad_ - lag_rad * phase) : 0.0;
  };
  v1::Command command;
  command.set_axis(axis_);
  command.set_tick(tick);
  command.set_gates(gates());
  put_setpoints(command, {.a = now_.constant.a + rotating(0),
                          .b = now_.constant.b + rotating(1),
                          .c = now_.constant.c + rotating(2),
                          .f = now_.constant.f});
  return command;
}

double OpenLoop::amplitude() const noexcept {
  return gates() == v1::GATES_OFF ? 0.0 : now_.boost + now_.per_hz * std::abs(now_.frequency_hz);
}

void OpenLoop::advance(double dt_s) noexcept {
  const double before_hz = now_.frequency_hz;
  if (progress_ < 1.0) {
    progress_ = std::min(1.0, progress_ + dt_s / target_.ramp_s);
    const auto moved = [&](double from, double to) { return blend(from, to, progress_); };
    now_.constant = {.a = moved(from_.constant.a, target_.constant.a),
                     .b = moved(from_.constant.b, target_.constant.b),
                     .c = moved(from_.constant.c, target_.constant.c),
                     .f = moved(from_.constant.f, target_.constant.f)};
    now_.boost = moved(from_.boost, target_.boost);
    now_.per_hz = moved(from_.per_hz, target_.per_hz);
    now_.frequency_hz = moved(from_.frequency_hz, target_.frequency_hz);
  }
  // The mean of a straight line: exact during a ramp.
  angle_rad_ = std::remainder(angle_rad_ + kTurn * 0.5 * (before_hz + now_.frequency_hz) * dt_s, kTurn);
}

}  // namespace drivebench::web
