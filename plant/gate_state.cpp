// The saved state of a GateAxis. Bytes from a client can be anything: what is in them is judged first.
#include <algorithm>
#include <cstring>
#include <type_traits>

#include "plant/gate_axis.hpp"

namespace drivebench {

std::vector<std::byte> GateAxis::save() {
  static_assert(std::is_trivially_copyable_v<Saved> && std::is_trivially_copyable_v<Logged>);
  catch_up();
  const Saved saved{
      .base = base_, .now = now_, .told = told_, .cut = cut_, .passed = passed_, .told_count = told_count_};
  std::vector<std::byte> bytes(sizeof(Saved) + told_count_ * sizeof(Logged));
  std::memcpy(bytes.data(), &saved, sizeof(Saved));
  std::memcpy(bytes.data() + sizeof(Saved), log_.data(), told_count_ * sizeof(Logged));
  return bytes;
}

bool GateAxis::is_possible_hall_count(std::int64_t count, const AxisState& state) const noexcept {
  if (!axis_.parameters().sensors.hall.enabled) return true;
  const std::int64_t there = hall_.count_at(state.shaft.angle_rad, state.turns);
  constexpr double kMostTurns = 1000.0;
  const auto most = static_cast<std::int64_t>(6.0 * kMostTurns * pole_pairs_);
  return count >= there - most && count <= there + most;
}

bool GateAxis::is_possible(const Logged& event) const noexcept {
  return event.edge.kind >= EventKind::kComparator && event.edge.kind <= EventKind::kBreak &&
         event.edge.channel < 3 && event.edge.level < 2 && event.edge.at >= 0 &&
         event.edge.at <= kLastPicosecond &&
         (event.edge.kind != EventKind::kHall || is_possible_hall_count(event.hall_count, base_.axis));
}

bool GateAxis::is_possible(const Saved& saved) const noexcept {
  const Clock& clock = saved.base.clock;
  const auto is_sign = [](std::int64_t flow) { return flow >= -1 && flow <= 1; };
  const auto is_leg = [&clock](const LegTimer& leg) { return leg.is_possible(clock.at); };
  return clock.at >= 0 && clock.at <= saved.now && saved.now <= kLastPicosecond &&
         (clock.tick_open == 0 || clock.tick_open == 1) && std::ranges::all_of(clock.legs, is_leg) &&
         std::ranges::all_of(clock.flow, is_sign) &&
         is_possible_hall_count(clock.hall_count, saved.base.axis) &&
         is_possible_hall_count(saved.told.hall_count, saved.base.axis) && saved.told.levels < 8;
}

bool GateAxis::restore(std::span<const std::byte> bytes,
                       bool (*is_possible_state)(const AxisState&) noexcept) {
  constexpr std::size_t kMostParts = 1000;
  Saved saved;
  if (bytes.size() < sizeof(Saved)) return false;
  std::memcpy(&saved, bytes.data(), sizeof(Saved));
  const std::span<const std::byte> events = bytes.subspan(sizeof(Saved));
  if (events.size() % sizeof(Logged) != 0 || events.size() / sizeof(Logged) != saved.told_count ||
      !is_possible_state(saved.base.axis) || !is_possible(saved))
    return false;
  base_ = saved.base;
  begin_with(base_.axis);
  now_ = saved.now;
  told_ = saved.told;
  cut_ = saved.cut;
  told_count_ = saved.told_count;
  passed_ = saved.passed;
  log_.resize(told_count_);
  std::memcpy(log_.data(), events.data(), events.size());
  if (!std::ranges::all_of(log_, [this](const Logged& event) { return is_possible(event); })) return false;
  axis_.restore(base_.axis);  // which may have another history
  go_back(base_);
  for (std::size_t n = 0; clock_.at < now_ || log_.size() < passed_; ++n) {
    if (n == kMostParts) return false;
    extend(LegTimer::kNever);
  }
  return true;
}

}  // namespace drivebench
