#pragma once

#include <cstdint>
#include <span>

#include "plant/injected_faults.hpp"
#include "plant/sensors/angle_path.hpp"
#include "plant/tick.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench {

/// Section [axis.hall]: three lines, each high for 180 electrical degrees, 120 degrees apart.
struct HallParameters {
  bool enabled = false;
  double offset_rad = 0.0;  ///< electrical angle by which they are displaced
  int capture_bits = 0;     ///< of a timer that the edges of the lines latch; 0: there is none
  double capture_hz = 0.0;  ///< its clock; it counts from 0 at tick 0 on and wraps
};

/// Lines 1, 2, 3 as bits 0, 1, 2 at an electrical angle n_p theta. Line k is high while that angle, less the
/// offset and less (k-1) 120 degrees, lies in [-30, 150) degrees. So without an offset the lines change where
/// a trapezoidal machine commutates (the book, (10.10)), and while it turns forward they say
///   angle    -30..30   30..90   90..150   150..210   210..270   270..330 degrees
///   lines         5        1         3          2          6          4
/// 0 and 7 come with a stuck line only. A sensor that is not enabled says 0.
std::uint32_t hall_lines(const HallParameters& p, const InjectedFaults& faults,
                         double electrical_rad) noexcept;

/// The same in a sector of 60 electrical degrees: sector 0 is -30..30 degrees, and they go on with the turns.
std::uint32_t hall_lines_in(std::int64_t sector, const InjectedFaults& faults) noexcept;

/// What the capture of the Hall lines remembers. 8-byte members only.
struct HallMemory {
  std::int64_t sector = 0;  ///< of 60 electrical degrees, counted through all turns
  double offset_rad = 0.0;  ///< to which it belongs
  std::uint64_t lines = 0;
  std::uint64_t edges = 0;
  Tick edge_tick = 0;   ///< of the last edge
  double edge_s = 0.0;  ///< from the start of that tick
};

/// The edges of the Hall lines: their number, and when the last one came. A stuck line has none; where a
/// fault or the offset changes the lines, their edge is at the start of the tick.
class HallCapture {
 public:
  HallCapture(const HallParameters& p, double pole_pairs, double period_s) noexcept;

  bool enabled() const noexcept { return p_.capture_bits > 0; }
  /// At rest at angle 0.
  HallMemory settled() const noexcept;
  /// The shaft through a tick or a part of it, given as consecutive segments. `turn` is the turn in which the
  /// tick started.
  void follow(HallMemory& m, std::span<const AngleSegment> segments, Tick tick, std::int64_t turn,
              const InjectedFaults& faults) const noexcept;
  /// The signals at the start of `tick`.
  void read(const HallMemory& m, Tick tick, Sample& sample) const noexcept;

 private:
  void follow(HallMemory& m, const PathPiece& piece, std::int64_t base, Tick tick,
              const InjectedFaults& faults) const noexcept;

  HallParameters p_;
  double period_s_;
  std::int64_t sectors_per_turn_;
  double sectors_per_rad_;  ///< of the rotor
};

}  // namespace drivebench
