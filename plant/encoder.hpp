#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "plant/rounding.hpp"
#include "plant/tick.hpp"

namespace drivebench {

/// An incremental encoder with index. The count is floor(theta N/(2 pi)), plus one half count if asked for.
struct EncoderParameters {
  int counts_per_revolution = 2000;  ///< N, after quadrature; a multiple of 4
  bool half_count_offset = false;    ///< centres the quantisation error on zero
};

/// The shaft between two integration nodes: its angle and speed at both ends. Between them the angle is the
/// cubic with these end values and slopes, which is exact at constant acceleration.
struct AngleSegment {
  double start_s;  ///< from the start of the tick
  double duration_s;
  double start_rad;  ///< angle within the turn in which the tick started
  double end_rad;
  double start_rad_s;
  double end_rad_s;
};

/// One change of the A or B line.
struct Edge {
  double time_s;       ///< from the start of the tick
  std::int64_t count;  ///< the count after the edge
  int direction;       ///< +1 or -1
};

/// Everything the encoder remembers from one tick to the next. 8-byte members only.
struct EncoderState {
  std::int64_t count = 0;
  std::int64_t last_edge_tick = 0;
  double last_edge_s = 0.0;            ///< from the start of last_edge_tick
  double period_s = 0.0;               ///< between the last two edges; 0 until there were two
  std::int64_t edges_seen = 0;         ///< 0, 1 or 2 (2: the period is valid)
  std::int64_t direction = 0;          ///< of the last edge; 0 before the first
  std::int64_t direction_changed = 0;  ///< 1: the last edge went the other way than the one before it
  std::int64_t index_tick = -1;        ///< tick in which the index line last rose; -1: never
  std::int64_t index_count = 0;        ///< latched at that edge
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
class Encoder {
 public:
  Encoder(const EncoderParameters& p, double period_s) noexcept;

  /// Follows the shaft through one tick, given as consecutive segments, from the count in the state. The cost
  /// does not depend on the speed: only the last two edges and the index are located. `turn` is the turn in
  /// which the tick started.
  void follow(EncoderState& state, std::span<const AngleSegment> segments, Tick tick,
              std::int64_t turn) const noexcept;

  /// The count at an angle within a turn.
  std::int64_t count_at(double angle_rad, std::int64_t turn) const noexcept;

  /// A, B, Z and flags. A leads B when the count rises; Z is high while the count is a multiple of N.
  std::uint32_t levels(const EncoderState& state) const noexcept;

  /// Time since the last edge at the start of `tick`; since tick 0 if there was none.
  double edge_age_s(const EncoderState& state, Tick tick) const noexcept;

  /// Calls visit(Edge) for every edge of the segments in the order of time. Not for the tick: the number of
  /// edges has no bound. `turn` and `count` are those at the start of the tick.
  template <class Visitor>
  void for_each_edge(std::span<const AngleSegment> segments, std::int64_t turn, std::int64_t count,
                     Visitor visit) const;

 private:
  /// A segment in counts, cut where the shaft reverses, so that the position is monotonic in it.
  struct Piece {
    double start_s;
    double duration_s;
    double start;  ///< position [counts], with the offset, within the turn
    double end;
    double start_slope;  ///< change of position over the piece if the speed stayed [counts]
    double end_slope;
  };
  struct Pieces {
    std::array<Piece, 3> piece;
    int size;
  };

  double position(double angle_rad) const noexcept;
  bool has_no_edge(const AngleSegment& segment) const noexcept;
  Pieces monotonic_pieces(const AngleSegment& segment) const noexcept;
  static Piece part(const Piece& whole, double from, double to) noexcept;
  static double time_of(const Piece& piece, double boundary) noexcept;

  EncoderParameters p_;
  double period_s_;
  double counts_per_rad_;
  double offset_;
};

template <class Visitor>
void Encoder::for_each_edge(std::span<const AngleSegment> segments, std::int64_t turn, std::int64_t count,
                            Visitor visit) const {
  const std::int64_t base = turn * p_.counts_per_revolution;
  for (const AngleSegment& segment : segments) {
    const Pieces pieces = monotonic_pieces(segment);
    for (int i = 0; i < pieces.size; ++i) {
      const Piece& piece = pieces.piece[static_cast<std::size_t>(i)];
      const std::int64_t last = base + floor_to_integer(piece.end);
      const int direction = last >= count ? 1 : -1;
      while (count != last) {
        const std::int64_t boundary = (direction > 0 ? count + 1 : count) - base;
        count += direction;
        visit(Edge{
            .time_s = time_of(piece, static_cast<double>(boundary)), .count = count, .direction = direction});
      }
    }
  }
}

}  // namespace drivebench
