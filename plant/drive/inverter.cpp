#include "plant/drive/inverter.hpp"

#include <algorithm>
#include <bit>

#include "plant/drive/phases.hpp"

namespace drivebench {
namespace {

/// An instant that carries the number of its terminal in the last two bits of the mantissa: less than 1e-15
/// of its value, and the two are sorted as one.
double marked(double instant_s, std::uint64_t terminal) noexcept {
  return std::bit_cast<double>((std::bit_cast<std::uint64_t>(instant_s) & ~std::uint64_t{3}) | terminal);
}

std::uint64_t terminal_of(double marked_s) noexcept {
  return std::bit_cast<std::uint64_t>(marked_s) & 3U;
}

/// A sorting network for six: no branch that depends on the voltages.
void sort_six(std::array<double, 6>& x) noexcept {
  const auto in_order = [&x](std::size_t i, std::size_t j) {
    const double low = std::min(x[i], x[j]);
    x[j] = std::max(x[i], x[j]);
    x[i] = low;
  };
  in_order(1, 2), in_order(4, 5);
  in_order(0, 2), in_order(3, 5);
  in_order(0, 1), in_order(3, 4), in_order(2, 5);
  in_order(0, 3), in_order(1, 4);
  in_order(2, 4), in_order(1, 3);
  in_order(2, 3);
}

}  // namespace

LimitedVoltages bridge_voltages(Connection connection, double bus_v, const ThreePhase& wanted_v) noexcept {
  if (connection != Connection::kStar) return clipped(wanted_v, bus_v);
  const double low_v = std::min({wanted_v.a, wanted_v.b, wanted_v.c});
  const double high_v = std::max({wanted_v.a, wanted_v.b, wanted_v.c});
  const bool saturated = high_v - low_v > bus_v;
  const double scale = saturated ? bus_v / (high_v - low_v) : 1.0;
  const double shift_v = 0.5 * (low_v + high_v);
  return {.voltage_v = by_phase([=](double x) { return scale * (x - shift_v); }, wanted_v),
          .saturated = saturated};
}

double averaged_voltage_v(double voltage_v, double rail_v, double dead_part, double current_a,
                          double band_a) noexcept {
  if (dead_part == 0.0) return voltage_v;
  const double switching_v = rail_v * (1.0 - 2.0 * std::min(dead_part, 0.5));
  if (voltage_v <= -switching_v) return -rail_v;
  if (voltage_v >= switching_v) return rail_v;
  const double direction = std::clamp(current_a / band_a, -1.0, 1.0);
  return voltage_v - direction * 2.0 * rail_v * dead_part;
}

void SwitchingPattern::set_voltages(const ThreePhase& voltage_v, int terminals, double rail_v,
                                    double dead_time_s, double period_s, std::uint32_t legs_off) noexcept {
  const std::array<double, 3> wanted_v{voltage_v.a, voltage_v.b, voltage_v.c};
  std::array<double, 6> first_half;
  first_half.fill(kNever);
  std::size_t count = 0;
  std::uint64_t passed = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals); ++k) {
    if ((legs_off >> k & 1U) != 0) {
      passed += kOff << (kBits * k);
      continue;
    }
    const double on = duty(wanted_v[k], rail_v, dead_time_s / period_s);
    if (on == 1.0) passed += kHigh << (kBits * k);
    if (on == 0.0 || on == 1.0) continue;
    const double rise_s = 0.5 * (1.0 - on) * period_s;
    first_half[count++] = marked(rise_s - 0.5 * dead_time_s, k);
    first_half[count++] = marked(rise_s + 0.5 * dead_time_s, k);
  }
  sort_six(first_half);
  std::size_t segment = 0;
  const auto end_segment = [&](double until_s, double marked_s) {
    segments_[segment++] = {.until_s = until_s, .passed = passed};
    passed += std::uint64_t{1} << (kBits * terminal_of(marked_s));
  };
  for (std::size_t n = 0; n < count; ++n)
    end_segment(first_half[n], first_half[n]);
  for (std::size_t n = count; n-- > 0;)
    end_segment(period_s - first_half[n], first_half[n]);
  segments_[segment] = {.until_s = kNever, .passed = passed};
}

namespace {

/// A leg on its way from edge to edge.
class LegWalk {
 public:
  explicit LegWalk(double dead_time_s) noexcept : dead_time_s_(dead_time_s) {}

  LegLevel level() const noexcept { return level_; }
  /// From when on it has this level; until then both switches are open.
  double closed_s() const noexcept { return closed_s_; }

  void go_to(LegLevel level, double now_s) noexcept {
    if (level == level_) return;
    if (level_ != LegLevel::kOff && closed_s_ <= now_s) opened_s_[index(level_)] = now_s;
    level_ = level;
    closed_s_ = now_s;
    if (level != LegLevel::kOff) closed_s_ = std::max(now_s, opened_s_[1 - index(level)] + dead_time_s_);
  }

 private:
  static constexpr std::size_t index(LegLevel level) noexcept { return level == LegLevel::kHigh ? 1 : 0; }

  double dead_time_s_;
  LegLevel level_ = LegLevel::kOff;
  double closed_s_ = 0.0;
  std::array<double, 2> opened_s_{-1e300, -1e300};  ///< lower and upper switch, last
};

/// A leg comes to another position.
struct Change {
  double at_s;
  std::uint64_t leg;
  LegLevel level;
};

/// The changes of all legs, sorted by time.
struct Changes {
  std::array<Change, kMaxSegmentsOfPattern - 1> change;
  std::size_t count = 0;

  void add(const Change& added) noexcept {
    std::size_t place = count++;
    for (; place > 0 && change[place - 1].at_s > added.at_s; --place)
      change[place] = change[place - 1];
    change[place] = added;
  }
};

/// Adds what a leg does until the next edge.
void add_until(const LegWalk& walk, std::uint64_t leg, double from_s, double until_s,
               Changes& changes) noexcept {
  if (walk.level() == LegLevel::kOff || walk.closed_s() > from_s) {
    changes.add({.at_s = from_s, .leg = leg, .level = LegLevel::kOff});
  }
  if (walk.level() != LegLevel::kOff && walk.closed_s() < until_s) {
    changes.add({.at_s = std::max(from_s, walk.closed_s()), .leg = leg, .level = walk.level()});
  }
}

constexpr double seconds(LegEdge edge) noexcept {
  return 1e-9 * static_cast<double>(edge.offset_ns());
}

void walk_along(const LegEdgeList& edges, double start_s, LegWalk& walk) noexcept {
  for (const LegEdge& edge : edges) {
    if (edge.level() == LegLevel::kNone) break;
    walk.go_to(edge.level(), start_s + seconds(edge));
  }
}

/// A list that is out of order takes its edges as they come, none before the one ahead of it.
void add_leg(const EdgeHistory& history, std::uint64_t leg, double dead_time_s, double period_s,
             Changes& changes) noexcept {
  const LegEdgeList& edges = history.now[leg];
  if (edges.front().level() == LegLevel::kNone) return;  // off
  LegWalk walk(dead_time_s);
  if (history.before[leg].front().level() != LegLevel::kNone) {
    walk_along(history.earlier[leg], -2.0 * period_s, walk);
    walk_along(history.before[leg], -period_s, walk);
  }
  double from_s = 0.0;
  for (const LegEdge& edge : edges) {
    if (edge.level() == LegLevel::kNone) break;
    const double at_s = std::max(from_s, seconds(edge));
    add_until(walk, leg, from_s, at_s, changes);
    walk.go_to(edge.level(), at_s);
    from_s = at_s;
  }
  add_until(walk, leg, from_s, period_s, changes);
}

}  // namespace

void SwitchingPattern::set_edges(const EdgeHistory& edges, int terminals, double dead_time_s, double period_s,
                                 std::uint32_t legs_off) noexcept {
  Changes changes;
  std::uint64_t passed = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals); ++k) {
    passed |= kOff << (kBits * k);
    if ((legs_off >> k & 1U) == 0) add_leg(edges, k, dead_time_s, period_s, changes);
  }
  std::size_t segment = 0;
  for (std::size_t n = 0; n < changes.count; ++n) {
    const Change& change = changes.change[n];
    if (change.at_s > 0.0) segments_[segment++] = {.until_s = change.at_s, .passed = passed};
    passed &= ~(std::uint64_t{7} << (kBits * change.leg));
    passed |= code_of(change.level) << (kBits * change.leg);
  }
  segments_[segment] = {.until_s = kNever, .passed = passed};
}

void SwitchingPattern::set_levels(const LegLevels& levels, int terminals) noexcept {
  std::uint64_t passed = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(terminals); ++k)
    passed |= code_of(levels[k]) << (kBits * k);
  segments_[0] = {.until_s = kNever, .passed = passed};
}

}  // namespace drivebench
