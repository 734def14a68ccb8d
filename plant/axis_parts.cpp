// A tick in parts, for GateAxis.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>

#include "plant/axis.hpp"
#include "plant/drive/phases.hpp"

namespace drivebench {

void Axis::copy_but_standing(const AxisState& from, AxisState& to) noexcept {
  static_assert(std::is_trivially_copyable_v<AxisState>);
  const auto* const begin = reinterpret_cast<const std::byte*>(&from);
  const auto copy = [&](const std::byte* first, const std::byte* last) noexcept {
    std::memcpy(reinterpret_cast<std::byte*>(&to) + (first - begin), first,
                static_cast<std::size_t>(last - first));
  };
  const auto commands = std::as_bytes(std::span(&from.drive.commands, 1));
  const auto sensors = std::as_bytes(std::span(&from.sensors, 1));
  copy(begin, commands.data());
  copy(commands.data() + commands.size(), sensors.data());
  copy(sensors.data() + sensors.size(), begin + sizeof(AxisState));
}

void Axis::open_tick(Tick tick) noexcept {
  begin_tick({}, tick);
  core_.follows = true;  // every piece reports
  open_tick_ = tick;
}

std::optional<PhaseValues> Axis::run_part(const LegLevels& levels, double start_s, double end_s) noexcept {
  const MotionState before = motion();
  core_.segment_count = 0;
  core_.drive.hold_legs(state_.drive, levels);
  const PhaseValues end_a = train_->run_part(core_, state_, start_s, end_s, load_at(core_.tick));
  if (!finite()) {
    hold(before);
    return std::nullopt;
  }
  check_over_current(core_, state_, end_a);
  // Of the sensors of the position only the count is read.
  core_.encoder.count(state_.encoder, last_tick(), core_.tick, core_.last_tick_turn, state_.injected);
  return end_a;
}

void Axis::close_tick() noexcept {
  core_.segment_count = 0;  // the sensors of the position have followed them
  end_tick(motion(), core_.tick);
}

void Axis::go_back(const AxisState& state, Tick tick) noexcept {
  const auto is_same = [&](const InjectableFault& row) {
    return state.injected.*row.member == state_.injected.*row.member;
  };
  const bool stays_open = open_tick_ == tick && !core_.p.thermal.enabled && !core_.bootstrap.used() &&
                          std::ranges::all_of(kInjectableFaults, is_same);
  if (!stays_open) return reopen(state, tick);
  copy_but_standing(state, state_);
  core_.breaks = state_.break_input.pending != 0 || watches_break(core_, state_);
}

void Axis::reopen(const AxisState& state, Tick tick) noexcept {
  state_ = state;
  open_tick(tick);
  state_ = state;
  adjust();
}

void Axis::take_changes(Tick tick) noexcept {
  const AxisState state = state_;
  reopen(state, tick);
  core_.drive.take_stiff_link(state_.drive);
}

GateTruth Axis::gate_truth(Tick tick) const noexcept {
  const RotorMotion motion{
      .angle_rad = state_.shaft.angle_rad, .speed_rad_s = state_.shaft.speed_rad_s, .electrical = {1.0, 0.0}};
  const MachineTruth truth = train_->truth(state_, motion);
  return {.current_a = phases_of(terminal_currents(core_.connection, truth.current_a, state_.open_terminals)),
          .torque_nm = truth.torque_nm,
          .load_nm = load_at(tick),
          .magnetic_j = train_->stored_energy_j(state_, motion),
          .hall_lines =
              hall_lines(core_.p.sensors.hall, state_.injected, core_.pole_pairs * state_.shaft.angle_rad)};
}

}  // namespace drivebench
