// The parts of a tick that a GateAxis integrates.
#include <algorithm>
#include <cmath>
#include <optional>

#include "plant/gate_axis.hpp"

namespace drivebench {
namespace {

std::int64_t sign_of(double current_a) noexcept {
  return current_a > 0.0 ? 1 : current_a < 0.0 ? -1 : 0;
}

/// Where a current of this sign, of ideal switches and diodes, puts the terminal; kOff if it floats.
LegLevel rail_of(LegLevel level, std::int64_t flow) noexcept {
  if (level != LegLevel::kOff || flow == 0) return level;
  return flow > 0 ? LegLevel::kLow : LegLevel::kHigh;
}

/// The instant, `until` at the latest, at which the leg moves its terminal whose current has this sign.
Picoseconds next_move(LegTimer leg, std::int64_t flow, Picoseconds until) noexcept {
  const LegLevel rail = rail_of(leg.level(), flow);
  while (leg.next() < until) {
    const Picoseconds at = leg.next();
    leg.go_to(at);
    if (rail == LegLevel::kOff || rail_of(leg.level(), flow) != rail) return at;
  }
  return until;
}

}  // namespace

double GateAxis::within_tick_s(Picoseconds at) const noexcept {
  return 1e-12 * static_cast<double>(at - tick() * period_);
}

Picoseconds GateAxis::at_of(double within_tick_s, Picoseconds from) const noexcept {
  return std::max(from, tick() * period_ + static_cast<Picoseconds>(std::llround(1e12 * within_tick_s)));
}

Picoseconds GateAxis::grid_after(Picoseconds at) const noexcept {
  const Picoseconds start = at / period_ * period_;
  const Picoseconds step = (at - start) * substeps_ / period_;
  for (Picoseconds n = step;; ++n) {
    const Picoseconds grid = start + n * period_ / substeps_;
    if (grid > at) return grid;
  }
}

GateAxis::Part GateAxis::part_up_to(Picoseconds limit, bool may_join) const noexcept {
  const Picoseconds from = clock_.at;
  Part part{.to = std::min(limit, grid_after(from))};
  std::array<Picoseconds, 3> change{};
  for (std::size_t k = 0; k < change.size(); ++k) {
    const LegTimer& leg = clock_.legs[k];
    part.levels[k] = leg.level();
    change[k] = leg.next();
    if (change[k] < part.to) part.to = may_join ? next_move(leg, clock_.flow[k], part.to) : change[k];
  }
  for (std::size_t k = 0; k < change.size(); ++k) {
    if (change[k] >= part.to) continue;
    part.levels[k] = rail_of(part.levels[k], clock_.flow[k]);
    part.joined |= std::uint64_t{1} << k;
  }
  return part;
}

bool GateAxis::run_part(const Part& part) {
  const Picoseconds from = clock_.at;
  tap_.begin_part();
  const std::optional<PhaseValues> end_a =
      axis_.run_part(part.levels, within_tick_s(from), within_tick_s(part.to));
  const std::array<double, 3> lowest_a{tap_.lowest_a.a, tap_.lowest_a.b, tap_.lowest_a.c};
  const std::array<double, 3> highest_a{tap_.highest_a.a, tap_.highest_a.b, tap_.highest_a.c};
  bool flows = true;
  for (std::size_t k = 0; k < clock_.legs.size(); ++k) {
    if ((part.joined >> k & 1U) == 0) continue;
    LegTimer& leg = clock_.legs[k];
    while (leg.next() < part.to)
      leg.go_to(leg.next());
    flows = flows && (clock_.flow[k] > 0 ? lowest_a[k] > 0.0 : highest_a[k] < 0.0);
  }
  if (!end_a) return true;
  if (!flows) return false;
  clock_.flow = {sign_of(end_a->a), sign_of(end_a->b), sign_of(end_a->c)};
  log_events(from);
  return true;
}

bool GateAxis::try_to_extend(Picoseconds limit, bool may_join) {
  const Picoseconds from = clock_.at;
  for (LegTimer& leg : clock_.legs)
    leg.go_to(from);
  const Part part = part_up_to(limit, may_join);
  if (part.joined != 0 && base_.clock.at != from) keep(unjoined_);
  if (clock_.tick_open == 0) axis_.open_tick(tick());
  clock_.tick_open = 1;
  if (clock_.diverged_from == LegTimer::kNever) {
    if (!run_part(part)) return false;
    if ((axis_.state().faults & kDiverged) != 0) clock_.diverged_from = from;
  }
  const bool ends_tick = part.to == (tick() + 1) * period_;
  if (ends_tick) {
    if (clock_.diverged_from == LegTimer::kNever) axis_.close_tick();
    clock_.tick_open = 0;
  }
  clock_.at = part.to;
  return true;
}

void GateAxis::extend(Picoseconds limit) {
  if (try_to_extend(limit, joins_legs_ && clock_.diverged_from == LegTimer::kNever)) return;
  go_back(base_.clock.at == clock_.at ? base_ : unjoined_);
  try_to_extend(limit, false);
}

}  // namespace drivebench
