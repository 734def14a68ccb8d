#include "clients/command/regression/cases/repeated_axis.hpp"

#include <algorithm>

namespace drivebench::command {
namespace {

std::uint64_t tick_of(const Answered& row) noexcept {
  return row.sample.tick;
}

/// Of a preset or an open bench, which give no duties.
link::AxisCommand repeated(const v1::Command& c) {
  return {.tick = c.tick(),
          .gates = c.gates(),
          .u_a_v = c.u_a_v(),
          .u_b_v = c.u_b_v(),
          .u_c_v = c.u_c_v(),
          .u_f_v = c.u_f_v(),
          .i_a_a = c.i_a_a(),
          .i_b_a = c.i_b_a(),
          .i_c_a = c.i_c_a(),
          .i_f_a = c.i_f_a()};
}

}  // namespace

RepeatedAxis::RepeatedAxis(link::AxisLink& axis, const RepeatedPart& part) : axis_(axis), until_(part.until) {
  if (until_ == 0) return;
  const std::string& name = axis.bench().axes(static_cast<int>(axis.axis())).name();
  recorded_ = read_run(part.recording.string(), name, 0).rows;
}

const Sample& RepeatedAxis::exchange(const link::AxisCommand& command) {
  if (command.tick >= until_) return axis_.exchange(command);
  const auto found = std::ranges::lower_bound(recorded_, command.tick, {}, tick_of);
  const bool is_recorded = found != recorded_.end() && tick_of(*found) == command.tick;
  return axis_.exchange(is_recorded ? repeated(found->command) : command);
}

}  // namespace drivebench::command
