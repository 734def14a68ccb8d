#include "plant/sensors/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

/// floor(count / divisor) for a positive divisor.
std::int64_t floor_divide(std::int64_t count, std::int64_t divisor) noexcept {
  const std::int64_t quotient = count / divisor;
  return quotient - (count % divisor < 0 ? 1 : 0);
}

}  // namespace

Encoder::Encoder(const EncoderParameters& p, double period_s) noexcept
    : p_(p),
      period_s_(period_s),
      counts_per_rad_(p.counts_per_revolution / (2.0 * std::numbers::pi)),
      offset_(p.half_count_offset ? 0.5 : 0.0) {}

double Encoder::position(double angle_rad) const noexcept {
  return angle_rad * counts_per_rad_ + offset_;
}

std::int64_t Encoder::count_at(double angle_rad, std::int64_t turn) const noexcept {
  return turn * p_.counts_per_revolution + floor_to_integer(position(angle_rad));
}

AngleSegment Encoder::View::seen(const AngleSegment& segment) const noexcept {
  if (eccentricity_rad == 0.0) return segment;
  const CosSin start = cos_sin(segment.start_rad);
  const CosSin end = cos_sin(segment.end_rad);
  if (std::isnan(start.sin) || std::isnan(end.sin)) return segment;  // 10^5 turns in a tick
  AngleSegment seen = segment;
  seen.start_rad += eccentricity_rad * start.sin;
  seen.end_rad += eccentricity_rad * end.sin;
  seen.start_rad_s *= 1.0 + eccentricity_rad * start.cos;
  seen.end_rad_s *= 1.0 + eccentricity_rad * end.cos;
  return seen;
}

std::int64_t Encoder::View::shown(std::int64_t count) const noexcept {
  if (lost_of > 0) count -= floor_divide(count, lost_of);
  if (extra_of > 0) count += floor_divide(count, extra_of);
  if (swapped) count = -count;
  // The lines of counts 0, 1, 2, 3 are A = 0110, B = 0011. Without A the decoder sees 0, 0, 3, 3, without B
  // 0, 1, 1, 0.
  if (lost_line == 1) return (count & 2) != 0 ? -1 : 0;
  if (lost_line == 2) return ((count + 1) & 2) != 0 ? 1 : 0;
  return count;
}

int Encoder::View::step_into(const EncoderState& state) const noexcept {
  if (lost_line == 0) return 0;
  const std::int64_t steps = (shown(state.count + state.ahead) - state.count) & 3;
  return steps == 3 ? -1 : static_cast<int>(steps);
}

Encoder::View Encoder::view_of(const InjectedFaults& faults) const noexcept {
  return {.swapped = p_.swapped != (faults.encoder_swapped != 0.0),
          .lost_line = static_cast<std::int64_t>(faults.encoder_lost_line),
          .lost_of = static_cast<std::int64_t>(faults.encoder_lost_pulses),
          .extra_of = static_cast<std::int64_t>(faults.encoder_extra_pulses),
          .eccentricity_rad = faults.encoder_eccentricity,
          .has_index = faults.encoder_index_missing == 0.0};
}

/// An encoder without faults, for which the compiler leaves out all that is about them.
struct Encoder::SoundView {
  static constexpr bool has_index = true;
  static const AngleSegment& seen(const AngleSegment& segment) noexcept { return segment; }
  static std::int64_t shown(std::int64_t count) noexcept { return count; }
  static bool is_still() noexcept { return false; }
  static int step_into(const EncoderState&) noexcept { return 0; }
};

/// The same for who asks for counts alone, not for the times of edges.
struct Encoder::CountView : SoundView {
  static bool is_still() noexcept { return true; }
};

/// The last two edges of a tick, the newest first, and the last index.
struct Encoder::Newest {
  std::array<double, 2> time_s{};
  std::array<std::int64_t, 2> direction{};
  std::size_t found = 0;
  bool index_found = false;
  std::int64_t index_count = 0;  ///< of a sound encoder

  bool complete() const noexcept { return found == time_s.size(); }
  void add(double edge_s, std::int64_t edge_direction) noexcept {
    time_s[found] = edge_s;
    direction[found++] = edge_direction;
  }
};

/// Looks backwards through the counts from `end` to `first`, of a sound encoder and within the turn.
template <class AnyView, class TimeOf>
void Encoder::search(const AnyView& view, Newest& newest, std::int64_t base, std::int64_t first,
                     std::int64_t end, const TimeOf& time_of_boundary) const noexcept {
  if (first == end) return;
  const int direction = end > first ? 1 : -1;
  if (!view.is_still()) {
    for (std::int64_t count = end; count != first && !newest.complete(); count -= direction) {
      std::int64_t steps = view.shown(base + count) - view.shown(base + count - direction);
      for (const int step = steps > 0 ? 1 : -1; steps != 0 && !newest.complete(); steps -= step)
        newest.add(time_of_boundary(static_cast<double>(direction > 0 ? count : count + 1)), step);
    }
  }
  // The index line rises where the count becomes a multiple of N: from below, or from the count above it.
  const std::int64_t shift = direction > 0 ? 0 : -1;
  const auto within_turn = [this](std::int64_t count) {
    return count >= 0 && count < p_.counts_per_revolution;
  };
  if (within_turn(first + shift) && within_turn(end + shift)) return;
  const std::int64_t turns_before = floor_divide(first + shift, p_.counts_per_revolution);
  const std::int64_t turns_after = floor_divide(end + shift, p_.counts_per_revolution);
  if (view.has_index && !newest.index_found && turns_before != turns_after) {
    newest.index_found = true;
    newest.index_count = base + (direction > 0 ? turns_after : turns_after + 1) * p_.counts_per_revolution;
  }
}

template <class AnyView>
void Encoder::follow_with(const AnyView& view, EncoderState& state, std::span<const AngleSegment> segments,
                          Tick tick, std::int64_t turn) const noexcept {
  const std::int64_t base = turn * p_.counts_per_revolution;
  const std::int64_t before = state.count + state.ahead - base;
  const std::int64_t at_start = floor_to_integer(position(view.seen(segments[0]).start_rad));
  // The tick starts with the count that the last one ended with: where the angle wraps in between, rounding
  // can put it on the other side of a boundary. More than that is a jump.
  const bool jumps = at_start - before > 1 || before - at_start > 1;
  const std::int64_t first_count = jumps ? at_start : before;
  Newest newest;
  for (std::size_t n = segments.size(); n-- > 0;) {
    const AngleSegment& segment = view.seen(segments[n]);
    const bool starts_at_count = n > 0 || at_start == first_count;
    const auto search_piece = [&](const PathPiece& piece, bool is_first) {
      const std::int64_t first = n == 0 && is_first ? first_count : floor_to_integer(piece.start);
      search(view, newest, base, first, floor_to_integer(piece.end),
             [&piece](double boundary) { return time_of(piece, boundary); });
    };
    const PathPiece whole = piece_of(segment);
    if (whole.is_monotonic()) {
      const bool has_edge = floor_to_integer(whole.start) != floor_to_integer(whole.end);
      if (has_edge || !starts_at_count) search_piece(whole, true);
      continue;
    }
    const PathPieces pieces = monotonic_pieces(whole);
    for (int i = pieces.size; i-- > 0;)
      search_piece(pieces.piece[static_cast<std::size_t>(i)], i == 0);
  }
  if (jumps) search(view, newest, base, before, at_start, [](double) { return 0.0; });
  const int into = view.step_into(state);
  for (int steps = into; steps != 0 && !newest.complete(); steps += steps > 0 ? -1 : 1)
    newest.add(0.0, steps > 0 ? 1 : -1);

  const std::int64_t end = base + floor_to_integer(position(view.seen(segments.back()).end_rad));
  const std::int64_t shown_end = view.shown(end);
  state.count += into + (shown_end - view.shown(base + before));
  state.ahead = end - state.count;
  if (newest.index_found) {
    state.index_tick = tick;
    state.index_count = state.count - (shown_end - view.shown(newest.index_count));
  }
  take(state, newest, tick);
}

void Encoder::take(EncoderState& state, const Newest& newest, Tick tick) const noexcept {
  if (newest.found == 0) return;
  const double before_s =  // the edge before the newest one, from the start of this tick
      newest.complete() ? newest.time_s[1]
                        : static_cast<double>(state.last_edge_tick - tick) * period_s_ + state.last_edge_s;
  const std::int64_t direction_before = newest.complete() ? newest.direction[1] : state.direction;
  const bool has_before = newest.complete() || state.edges_seen > 0;
  state.period_s = has_before ? newest.time_s[0] - before_s : 0.0;
  state.edges_seen = has_before ? 2 : 1;
  state.direction_changed = has_before && direction_before != newest.direction[0] ? 1 : 0;
  state.direction = newest.direction[0];
  state.last_edge_tick = tick;
  state.last_edge_s = newest.time_s[0];
}

bool Encoder::is_sound(const InjectedFaults& faults) const noexcept {
  const double size = faults.encoder_swapped + faults.encoder_lost_line + faults.encoder_lost_pulses +
                      faults.encoder_extra_pulses + faults.encoder_index_missing +
                      faults.encoder_eccentricity;
  return size == 0.0 && !p_.swapped;
}

bool Encoder::keeps_count(const EncoderState& state, std::span<const AngleSegment> segments,
                          std::int64_t turn) const noexcept {
  constexpr double kAstray = 0.15;  // above 4/27
  constexpr double kRounding = 1e-14;
  const auto count = static_cast<double>(state.count + state.ahead - turn * p_.counts_per_revolution);
  const auto is_within = [count](double place, double astray) noexcept {
    return place - astray >= count && place + astray < count + 1.0;
  };
  if (!is_within(position(segments.back().end_rad), 0.0)) return false;
  return std::ranges::all_of(segments, [&](const AngleSegment& s) noexcept {
    const double slopes_rad = s.duration_s * (std::abs(s.start_rad_s) + std::abs(s.end_rad_s));
    const double rounding = slopes_rad > 0.0 ? kRounding * (1.0 + std::abs(count)) : 0.0;
    const double astray = kAstray * counts_per_rad_ * slopes_rad + rounding;
    return is_within(position(s.start_rad), astray) && is_within(position(s.end_rad), astray);
  });
}

void Encoder::follow(EncoderState& state, std::span<const AngleSegment> segments, Tick tick,
                     std::int64_t turn, const InjectedFaults& faults) const noexcept {
  if (segments.empty()) return;
  if (is_sound(faults)) {
    if (keeps_count(state, segments, turn)) return;
    follow_with(SoundView{}, state, segments, tick, turn);
  } else {
    follow_with(view_of(faults), state, segments, tick, turn);
  }
}

void Encoder::count(EncoderState& state, std::span<const AngleSegment> segments, Tick tick, std::int64_t turn,
                    const InjectedFaults& faults) const noexcept {
  if (segments.empty()) return;
  if (is_sound(faults)) {
    if (keeps_count(state, segments, turn)) return;
    follow_with(CountView{}, state, segments, tick, turn);
  } else {
    follow_with(view_of(faults), state, segments, tick, turn);
  }
}

std::uint32_t Encoder::levels(const EncoderState& state, const InjectedFaults& faults) const noexcept {
  const std::int64_t phase = state.count & 3;  // 0: A=0 B=0, 1: A=1 B=0, 2: A=1 B=1, 3: A=0 B=1
  std::uint32_t levels = 0;
  if (phase == 1 || phase == 2) levels |= kLevelA;
  if (phase == 2 || phase == 3) levels |= kLevelB;
  const bool at_index = (state.count + state.ahead) % p_.counts_per_revolution == 0;
  if (at_index && faults.encoder_index_missing == 0.0) levels |= kLevelZ;
  if (state.direction < 0) levels |= kReverse;
  if (state.direction_changed != 0) levels |= kDirectionChanged;
  if (state.edges_seen == 2) levels |= kPeriodValid;
  return levels;
}

std::uint64_t Encoder::capture(const EncoderState& state) const noexcept {
  const double clocks = state.period_s * p_.capture_hz;
  if (!(clocks > 0.0)) return 0;
  const std::uint64_t most = timer_mask();
  return clocks < static_cast<double>(most) ? static_cast<std::uint64_t>(clocks) : most;
}

double Encoder::edge_age_s(const EncoderState& state, Tick tick) const noexcept {
  return static_cast<double>(tick - state.last_edge_tick) * period_s_ - state.last_edge_s;
}

}  // namespace drivebench
