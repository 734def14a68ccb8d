#include "plant/sensors/hall.hpp"

#include <array>
#include <cstddef>

#include "plant/math/rounding.hpp"

namespace drivebench {
namespace {

constexpr double kSectorsPerRad = 0x1.e8ec8a4aeacc4p-1;  // 3/pi

/// The bit of line 1, 2 or 3; no bit for 0.
constexpr std::uint32_t line_bit(double line) noexcept {
  return line > 0.0 ? 1u << static_cast<std::uint32_t>(line - 1.0) : 0u;
}

/// Whether a line changes between a sector and the next one.
bool has_edge(std::int64_t sector, const InjectedFaults& faults) noexcept {
  return hall_lines_in(sector, faults) != hall_lines_in(sector + 1, faults);
}

/// The edges on the way up from one sector to another.
std::int64_t edges_between(std::int64_t low, std::int64_t high, const InjectedFaults& faults) noexcept {
  const auto count = [&faults](std::int64_t from, std::int64_t to) {
    std::int64_t edges = 0;
    for (; from != to; ++from)
      edges += has_edge(from, faults) ? 1 : 0;
    return edges;
  };
  const std::int64_t whole = (high - low) / 6;
  return (whole > 0 ? whole * count(0, 6) : 0) + count(low + 6 * whole, high);
}

}  // namespace

std::uint32_t hall_lines(const HallParameters& p, const InjectedFaults& faults,
                         double electrical_rad) noexcept {
  if (!p.enabled) return 0;
  const double angle_rad = electrical_rad - (p.offset_rad + faults.hall_offset);
  return hall_lines_in(floor_to_integer(angle_rad * kSectorsPerRad + 0.5), faults);
}

std::uint32_t hall_lines_in(std::int64_t sector, const InjectedFaults& faults) noexcept {
  constexpr std::array<std::uint32_t, 6> kLines{5, 1, 3, 2, 6, 4};
  sector %= 6;
  const std::uint32_t lines = kLines[static_cast<std::size_t>(sector < 0 ? sector + 6 : sector)];
  return (lines | line_bit(faults.hall_stuck_high)) & ~line_bit(faults.hall_stuck_low);
}

HallCapture::HallCapture(const HallParameters& p, double pole_pairs, double period_s) noexcept
    : p_(p),
      period_s_(period_s),
      sectors_per_turn_(6 * static_cast<std::int64_t>(pole_pairs)),
      sectors_per_rad_(pole_pairs * kSectorsPerRad) {}

HallMemory HallCapture::settled() const noexcept {
  HallMemory m;
  if (!enabled()) return m;
  m.sector = floor_to_integer(0.5 - p_.offset_rad * kSectorsPerRad);
  m.offset_rad = p_.offset_rad;
  m.lines = hall_lines_in(m.sector, kNoFaults);
  return m;
}

void HallCapture::follow(HallMemory& m, std::span<const AngleSegment> segments, Tick tick, std::int64_t turn,
                         const InjectedFaults& faults) const noexcept {
  if (segments.empty()) return;
  const double offset_rad = p_.offset_rad + faults.hall_offset;
  const double offset = 0.5 - offset_rad * kSectorsPerRad;
  const std::int64_t base = turn * sectors_per_turn_;
  // Where the angle wraps, rounding can put the start on the other side of a boundary; the sector then stays
  // what it was.
  const std::int64_t start = base + floor_to_integer(segments[0].start_rad * sectors_per_rad_ + offset);
  if (offset_rad != m.offset_rad || start - m.sector > 1 || m.sector - start > 1) {
    m.sector = start;
    m.offset_rad = offset_rad;
  }
  if (const std::uint32_t lines = hall_lines_in(m.sector, faults); lines != m.lines) {
    m.lines = lines;
    m.edges += 1;
    m.edge_tick = tick;
    m.edge_s = segments[0].start_s;
  }
  for (const AngleSegment& segment : segments) {
    const PathPiece whole = path_piece(segment, sectors_per_rad_, offset);
    if (whole.is_monotonic()) {
      if (base + floor_to_integer(whole.end) != m.sector) follow(m, whole, base, tick, faults);
      continue;
    }
    const PathPieces pieces = monotonic_pieces(whole);
    for (int n = 0; n < pieces.size; ++n)
      follow(m, pieces.piece[static_cast<std::size_t>(n)], base, tick, faults);
  }
}

void HallCapture::follow(HallMemory& m, const PathPiece& piece, std::int64_t base, Tick tick,
                         const InjectedFaults& faults) const noexcept {
  const std::int64_t from = m.sector;
  const std::int64_t to = base + floor_to_integer(piece.end);
  if (to == from) return;
  m.sector = to;
  const bool rises = to > from;
  const std::int64_t edges = rises ? edges_between(from, to, faults) : edges_between(to, from, faults);
  if (edges == 0) return;
  // The boundary above this sector is the last one that the lines have shown.
  std::int64_t below = rises ? to - 1 : to;
  while (!has_edge(below, faults))
    below += rises ? -1 : 1;
  m.lines = hall_lines_in(to, faults);
  m.edges += static_cast<std::uint64_t>(edges);
  m.edge_tick = tick;
  m.edge_s = time_of(piece, static_cast<double>(below + 1 - base));
}

void HallCapture::read(const HallMemory& m, Tick tick, Sample& sample) const noexcept {
  sample.hall_edges = m.edges;
  sample.hall_edge_age_s = static_cast<double>(tick - m.edge_tick) * period_s_ - m.edge_s;
  const double clocks = (static_cast<double>(m.edge_tick) * period_s_ + m.edge_s) * p_.capture_hz;
  constexpr double kMost = 0x1p62;  // no run comes that far
  if (!(clocks >= 0.0 && clocks < kMost)) return;
  const std::uint64_t mask = (std::uint64_t{1} << p_.capture_bits) - 1;
  sample.hall_capture = static_cast<std::uint64_t>(clocks) & mask;
}

}  // namespace drivebench
