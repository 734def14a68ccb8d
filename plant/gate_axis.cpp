#include "plant/gate_axis.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <variant>

namespace drivebench {
namespace {

AxisParameters with_terminals(AxisParameters p) {
  p.sensors.terminals = true;
  return p;
}

/// next_edge() and what base_ is behind now by [parts].
constexpr std::size_t kMostBehind = 16;

/// Whether an open switch beside a conducting diode is as good as a closed one.
bool can_join_legs(const AxisParameters& p) {
  return !has_switch_losses(p.drive) && p.drive.inverter.bootstrap_s == 0.0;
}

double pole_pairs_of_machine(const AxisParameters& p) {
  return std::visit([](const auto& machine) { return pole_pairs_of(machine); }, p.machine);
}

}  // namespace

GateAxis::GateAxis(const AxisParameters& p, std::int64_t period_ns, int substeps, std::uint64_t seed,
                   std::uint64_t index)
    : axis_(with_terminals(p), {.period_s = 1e-9 * static_cast<double>(period_ns), .substeps = substeps},
            seed, index),
      hall_({.counts_per_revolution = 6 * static_cast<int>(pole_pairs_of_machine(p)),
             .half_count_offset = true},
            1e-9 * static_cast<double>(period_ns)),
      pole_pairs_(pole_pairs_of_machine(p)),
      joins_legs_(can_join_legs(p)),
      period_(1000 * period_ns),
      substeps_(substeps) {
  constexpr std::size_t kRoomForEvents = 1024;
  log_.reserve(kRoomForEvents);
  axis_.report_to(&tap_);
  clock_.hall_count = hall_.count_at(-p.sensors.hall.offset_rad / pole_pairs_, 0);
  begin_with(axis_.state());
  keep(base_);
  told_ = {.levels = axis_.state().comparators.levels, .hall_count = clock_.hall_count};
}

void GateAxis::keep(Moment& moment) const {
  moment.clock = clock_;
  moment.sums = tap_.sums;
  Axis::copy_but_standing(axis_.state(), moment.axis);
}

void GateAxis::begin_with(const AxisState& state) {
  base_.axis = here_.axis = unjoined_.axis = aside_.axis = state;
  here_.clock.at = kNowhere;
}

void GateAxis::begin_here() {
  keep(base_);
  ahead_ = 0;
  catch_up_at_ = LegTimer::kNever;
  here_.clock.at = kNowhere;
}

void GateAxis::go_back(const AxisState& state) {
  if (clock_.tick_open != 0) {
    axis_.go_back(state, tick());
  } else {
    axis_.restore(state);
  }
}

void GateAxis::go_back(const Moment& moment) {
  clock_ = moment.clock;
  tap_.sums = moment.sums;
  go_back(moment.axis);
}

void GateAxis::log_events(Picoseconds from) {
  const std::size_t first = log_.size();
  for (std::size_t n = 0; n < tap_.events.size(); ++n) {
    const PlantEvent& event = tap_.events[n];
    const GateEdge edge{
        .at = at_of(event.at_s, from), .kind = event.kind, .channel = event.channel, .level = event.level};
    if (!in_cut(edge)) log_one({.edge = edge}, first);
  }
  if (axis_.parameters().sensors.hall.enabled) log_hall(from);
}

/// In the order of time; events of one instant in the order in which they came.
void GateAxis::log_one(const Logged& event, std::size_t first) {
  std::size_t place = log_.size();
  while (place > first && log_[place - 1].edge.at > event.edge.at)
    --place;
  log_.insert(log_.begin() + static_cast<std::ptrdiff_t>(place), event);
}

void GateAxis::log_hall(Picoseconds from) {
  const std::size_t first = log_.size();
  const HallParameters& p = axis_.parameters().sensors.hall;
  const InjectedFaults& faults = axis_.injected();
  const double offset_rad = (p.offset_rad + faults.hall_offset) / pole_pairs_;
  for (AngleSegment segment : axis_.last_tick()) {
    segment.start_rad -= offset_rad;
    segment.end_rad -= offset_rad;
    hall_.for_each_edge(std::span(&segment, 1), axis_.last_tick_turn(), clock_.hall_count,
                        [&](const Edge& edge) {
                          const std::uint32_t before = hall_lines_in(clock_.hall_count, faults);
                          const std::uint32_t changed = before ^ hall_lines_in(edge.count, faults);
                          clock_.hall_count = edge.count;
                          for (std::uint32_t line = 0; line < 3; ++line) {
                            if ((changed >> line & 1U) == 0) continue;
                            log_one({.edge = {.at = at_of(edge.time_s, from),
                                              .kind = EventKind::kHall,
                                              .channel = line,
                                              .level = ~before >> line & 1U},
                                     .hall_count = edge.count},
                                    first);
                          }
                        });
  }
}

void GateAxis::tell(const Logged& event) noexcept {
  if (event.edge.kind == EventKind::kHall) told_.hall_count = event.hall_count;
  if (event.edge.kind != EventKind::kComparator) return;
  told_.levels ^= std::uint64_t{1} << event.edge.channel;
  ++told_.edges[event.edge.channel];
}

std::uint64_t GateAxis::bit_in_cut(const GateEdge& edge) noexcept {
  if (edge.kind == EventKind::kCurrentZero) return std::uint64_t{1} << edge.channel;
  return edge.kind == EventKind::kBreak ? 8 : 0;
}

void GateAxis::add_to_cut() noexcept {
  if (cut_.at != now_) cut_ = {.at = now_};
  for (const Logged& event : log_) {
    if (event.edge.at == now_) cut_.told |= bit_in_cut(event.edge);
  }
}

void GateAxis::run_to_now() {
  if (here_.clock.at == now_) {
    go_back(here_);
  } else {
    const std::size_t known = log_.size();
    go_back(base_);
    while (clock_.at < now_) {
      extend(now_);
      log_.resize(known);
    }
    keep(here_);
  }
  clock_.hall_count = told_.hall_count;
  if (axis_.state().comparators.levels == told_.levels && axis_.state().comparators.edges == told_.edges)
    return;
  AxisState state = axis_.state();
  state.comparators.levels = told_.levels;
  state.comparators.edges = told_.edges;
  go_back(state);
}

void GateAxis::stop_here() {
  add_to_cut();
  const auto passed = log_.begin() + static_cast<std::ptrdiff_t>(passed_);
  auto later = passed;
  for (; later != log_.end() && later->edge.at <= now_; ++later) {
    if (static_cast<std::size_t>(later - log_.begin()) >= told_count_) tell(*later);
  }
  log_.erase(later, log_.end());
  log_.erase(log_.begin(), passed);
  passed_ = 0;
  told_count_ = log_.size();
  if (clock_.at != now_) run_to_now();
  begin_here();
}

void GateAxis::catch_up() {
  if (passed_ < told_count_) return;
  keep(aside_);
  const Picoseconds begun = base_.clock.at;
  const std::size_t known = log_.size();
  std::size_t over = told_count_;
  Picoseconds parts = 0;
  go_back(base_);
  while (true) {
    extend(LegTimer::kNever);
    const std::size_t here = log_.size() - known;
    log_.resize(known);
    if (clock_.at > now_ || over + here > passed_) break;
    over += here;
    ++parts;
    keep(base_);
  }
  go_back(aside_);
  if (parts == 0) return;
  log_.erase(log_.begin(), log_.begin() + static_cast<std::ptrdiff_t>(over));
  passed_ -= over;
  told_count_ = 0;
  told_.hall_count = base_.clock.hall_count;
  for (std::size_t n = 0; n < passed_; ++n) {
    if (log_[n].edge.kind == EventKind::kHall) told_.hall_count = log_[n].hall_count;
  }
  const Picoseconds usual = (base_.clock.at - begun) / parts;
  catch_up_at_ = base_.clock.at + static_cast<Picoseconds>(kMostBehind) * std::max<Picoseconds>(usual, 1);
}

void GateAxis::set_leg(std::size_t leg, const LegSetting& setting) {
  if (clock_.legs[leg].setting() == setting) return;
  stop_here();
  clock_.legs[leg].set(setting, now_);
  keep(base_);
}

void GateAxis::set_load(double load_nm) {
  stop_here();
  axis_.set_load(load_nm, tick(), 0);
  keep(base_);
}

void GateAxis::set_parameters(const AxisParameters& p) {
  stop_here();
  axis_.set_parameters(with_terminals(p));
  joins_legs_ = can_join_legs(p);
  if (clock_.tick_open != 0) axis_.take_changes(tick());
  keep(base_);
}

void GateAxis::inject(std::size_t row, double value) {
  stop_here();
  axis_.inject(row, value);
  if (clock_.tick_open != 0) axis_.take_changes(tick());
  keep(base_);
}

void GateAxis::clear_faults() {
  stop_here();
  axis_.clear_faults();
  if (clock_.tick_open != 0) axis_.take_changes(tick());
  clock_.diverged_from = LegTimer::kNever;
  keep(base_);
}

std::size_t GateAxis::run(Picoseconds until, std::span<GateEdge> edges) {
  const auto end_at = [this](Picoseconds at) {
    now_ = at;
    if (now_ >= catch_up_at_) catch_up();
  };
  std::size_t written = 0;
  while (true) {
    while (passed_ < log_.size() && log_[passed_].edge.at <= until) {
      const Logged event = log_[passed_++];
      if (passed_ > told_count_) tell(event);
      if (edges.empty()) continue;
      edges[written++] = event.edge;
      if (written < edges.size()) continue;
      end_at(event.edge.at);
      return written;
    }
    if (clock_.at >= until) break;
    log_.clear();
    passed_ = told_count_ = 0;
    told_.hall_count = clock_.hall_count;
    begin_here();
    extend(LegTimer::kNever);
  }
  end_at(until);
  return written;
}

std::optional<GateEdge> GateAxis::next_edge(Picoseconds limit) {
  while (passed_ == log_.size() && clock_.at < limit) {
    extend(LegTimer::kNever);
    if (++ahead_ == kMostBehind) catch_up_at_ = std::min(catch_up_at_, clock_.at);
  }
  if (passed_ == log_.size() || log_[passed_].edge.at > limit) return std::nullopt;
  return log_[passed_].edge;
}

GateAxis::Now GateAxis::look() {
  if (clock_.at == now_) return seen();
  keep(aside_);
  run_to_now();
  const Now now = seen();
  go_back(aside_);
  return now;
}

GateAxis::Now GateAxis::seen() const {
  LegLevels levels{};
  for (std::size_t k = 0; k < levels.size(); ++k)
    levels[k] = clock_.legs[k].level();
  return {.state = axis_.state(), .truth = axis_.gate_truth(tick()), .sums = tap_.sums, .levels = levels};
}

}  // namespace drivebench
