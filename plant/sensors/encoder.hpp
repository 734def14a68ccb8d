#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "plant/injected_faults.hpp"
#include "plant/math/rounding.hpp"
#include "plant/sensors/angle_path.hpp"
#include "plant/tick.hpp"

namespace drivebench {

/// An incremental encoder with index. The count is floor(theta N/(2 pi)), plus one half count if asked for.
struct EncoderParameters {
  int counts_per_revolution = 2000;  ///< N, after quadrature; a multiple of 4
  bool half_count_offset = false;    ///< centres the quantisation error on zero
  bool swapped = false;              ///< A and B are exchanged: the count falls when the angle rises
  int timer_bits = 0;                ///< of the timers that follow the lines; 0: there are none
  double capture_hz = 0.0;  ///< clock of the timer that measures the time between edges; 0: there is none
};

/// One change of the A or B line.
struct Edge {
  double time_s;       ///< from the start of the tick
  std::int64_t count;  ///< the count after the edge
  int direction;       ///< +1 or -1
};

/// Everything the encoder remembers from one tick to the next. 8-byte members only.
struct EncoderState {
  std::int64_t count = 0;  ///< as a decoder on the lines A and B has it
  std::int64_t last_edge_tick = 0;
  double last_edge_s = 0.0;            ///< from the start of last_edge_tick
  double period_s = 0.0;               ///< between the last two edges; 0 until there were two
  std::int64_t edges_seen = 0;         ///< 0, 1 or 2 (2: the period is valid)
  std::int64_t direction = 0;          ///< of the last edge; 0 before the first
  std::int64_t direction_changed = 0;  ///< 1: the last edge went the other way than the one before it
  std::int64_t index_tick = -1;        ///< tick in which the index line last rose; -1: never
  std::int64_t index_count = 0;        ///< latched at that edge
  std::int64_t ahead = 0;  ///< count of a sound encoder less `count`: what faults have made of it so far
};

/// Line levels as bits, and the flags that go with them.
enum EncoderLevel : std::uint32_t {
  kLevelA = 1u << 0,
  kLevelB = 1u << 1,
  kLevelZ = 1u << 2,
  kReverse = 1u << 3,           ///< the last edge counted down
  kDirectionChanged = 1u << 4,  ///< the last edge went the other way than the one before it
  kPeriodValid = 1u << 5,       ///< two edges have been seen
};

/// Follows a shaft and says what an encoder on it would.
///
/// Faults change what the lines do, and the count is what a decoder makes of the lines: at every instant A
/// and B are those of the last two bits of the count, and it changes by one with each edge. With `swapped`
/// each edge counts the other way. A lost line stays low, so that the count goes to and fro between two
/// neighbours; if A and B do not fit to that when the fault comes, the lines fall in at the start of the
/// tick, one edge after the other. Of lost pulses only every n-th count has no edge, in both directions of
/// rotation alike; of extra pulses every n-th has two, at one instant. Eccentricity adds its amplitude times
/// sin(theta) to the angle; the edges by which the count jumps where it comes or goes fall on the start of
/// the tick. A fault that ends leaves the count where it is, except that eccentricity takes its error with
/// it. Z stays with the disc.
class Encoder {
 public:
  Encoder(const EncoderParameters& p, double period_s) noexcept;

  /// Follows the shaft through one tick, given as consecutive segments, from the count in the state. The cost
  /// does not depend on the speed: only the last two edges and the index are located. `turn` is the turn in
  /// which the tick started.
  void follow(EncoderState& state, std::span<const AngleSegment> segments, Tick tick, std::int64_t turn,
              const InjectedFaults& faults = kNoFaults) const noexcept;
  /// The same for the count and the index alone: a sound encoder's edges are not located.
  void count(EncoderState& state, std::span<const AngleSegment> segments, Tick tick, std::int64_t turn,
             const InjectedFaults& faults) const noexcept;

  /// The count at an angle within a turn.
  std::int64_t count_at(double angle_rad, std::int64_t turn) const noexcept;

  /// A, B, Z and flags. A leads B when the count rises; Z is high while the count of a sound encoder is a
  /// multiple of N.
  std::uint32_t levels(const EncoderState& state, const InjectedFaults& faults = kNoFaults) const noexcept;

  /// Time since the last edge at the start of `tick`; since tick 0 if there was none.
  double edge_age_s(const EncoderState& state, Tick tick) const noexcept;

  /// What a quadrature timer of timer_bits reads: the count, which wraps.
  std::uint64_t timer(const EncoderState& state) const noexcept {
    return static_cast<std::uint64_t>(state.count) & timer_mask();
  }
  /// Whole clocks of capture_hz between the last two edges, at most what timer_bits hold; 0 until there were
  /// two.
  std::uint64_t capture(const EncoderState& state) const noexcept;

  /// Calls visit(Edge) for every edge of the segments in the order of time: those that follow() counts. Not
  /// for the tick: the number of edges has no bound. `turn`, count and `ahead` of the state are those at the
  /// start of the tick.
  template <class Visitor>
  void for_each_edge(std::span<const AngleSegment> segments, std::int64_t turn, const EncoderState& start,
                     const InjectedFaults& faults, Visitor visit) const;

  /// The same without faults.
  template <class Visitor>
  void for_each_edge(std::span<const AngleSegment> segments, std::int64_t turn, std::int64_t count,
                     Visitor visit) const {
    for_each_edge(segments, turn, EncoderState{.count = count}, kNoFaults, visit);
  }

 private:
  /// The largest number of a timer; 0 without one.
  std::uint64_t timer_mask() const noexcept { return (std::uint64_t{1} << p_.timer_bits) - 1; }

  /// A sound encoder under the injected faults.
  struct View {
    bool swapped;
    std::int64_t lost_line;  ///< 1: A, 2: B
    std::int64_t lost_of;    ///< of every so many counts one is lost; 0: none
    std::int64_t extra_of;   ///< of every so many counts that are left one comes twice; 0: none
    double eccentricity_rad;
    bool has_index;

    /// The segment as the disc sees it.
    AngleSegment seen(const AngleSegment& segment) const noexcept;
    /// The count that a decoder shows for the count of a sound encoder, but for a constant. Steps by two at
    /// most.
    std::int64_t shown(std::int64_t count) const noexcept;
    /// No count has an edge.
    bool is_still() const noexcept { return lost_of == 1; }
    /// Steps of the count by which the lines fall in with a lost line: -1 to 2.
    int step_into(const EncoderState& state) const noexcept;
  };
  struct SoundView;
  struct CountView;
  struct Newest;

  bool is_sound(const InjectedFaults& faults) const noexcept;
  /// Whether the count of a sound encoder surely stays the same on these segments, as while the shaft stands:
  /// then follow() would change nothing. It looks at the ends of a segment alone: between them the cubic
  /// leaves their range by at most 4/27 of the sum of its end slopes. It is false close to an edge, because
  /// rounding may put one where a cubic turns.
  bool keeps_count(const EncoderState& state, std::span<const AngleSegment> segments,
                   std::int64_t turn) const noexcept;
  View view_of(const InjectedFaults& faults) const noexcept;
  template <class AnyView>
  void follow_with(const AnyView& view, EncoderState& state, std::span<const AngleSegment> segments,
                   Tick tick, std::int64_t turn) const noexcept;
  template <class AnyView, class TimeOf>
  void search(const AnyView& view, Newest& newest, std::int64_t base, std::int64_t first, std::int64_t end,
              const TimeOf& time_of) const noexcept;
  void take(EncoderState& state, const Newest& newest, Tick tick) const noexcept;
  double position(double angle_rad) const noexcept;
  /// A segment in counts, with the offset.
  PathPiece piece_of(const AngleSegment& segment) const noexcept {
    return path_piece(segment, counts_per_rad_, offset_);
  }

  EncoderParameters p_;
  double period_s_;
  double counts_per_rad_;
  double offset_;
};

template <class Visitor>
void Encoder::for_each_edge(std::span<const AngleSegment> segments, std::int64_t turn,
                            const EncoderState& start, const InjectedFaults& faults, Visitor visit) const {
  if (segments.empty()) return;
  const View view = view_of(faults);
  std::int64_t shown = start.count;
  const auto step_shown = [&](std::int64_t step, double time_s) {
    shown += step;
    visit(Edge{.time_s = time_s, .count = shown, .direction = static_cast<int>(step)});
  };
  for (int steps = view.step_into(start); steps != 0; steps += steps > 0 ? -1 : 1)
    step_shown(steps > 0 ? 1 : -1, 0.0);

  std::int64_t count = start.count + start.ahead;
  const auto go_to = [&](std::int64_t last, const auto& time_of_boundary) {
    const int direction = last >= count ? 1 : -1;
    for (; count != last; count += direction) {
      std::int64_t steps = view.shown(count + direction) - view.shown(count);
      for (const int step = steps > 0 ? 1 : -1; steps != 0; steps -= step)
        step_shown(step, time_of_boundary(direction > 0 ? count + 1 : count));
    }
  };
  const std::int64_t base = turn * p_.counts_per_revolution;
  const std::int64_t at_start = base + floor_to_integer(position(view.seen(segments[0]).start_rad));
  if (at_start - count > 1 || count - at_start > 1) {
    go_to(at_start, [](std::int64_t) { return 0.0; });
  }
  for (const AngleSegment& segment : segments) {
    const PathPieces pieces = monotonic_pieces(piece_of(view.seen(segment)));
    for (int i = 0; i < pieces.size; ++i) {
      const PathPiece& piece = pieces.piece[static_cast<std::size_t>(i)];
      go_to(base + floor_to_integer(piece.end),
            [&](std::int64_t boundary) { return time_of(piece, static_cast<double>(boundary - base)); });
    }
  }
}

}  // namespace drivebench
