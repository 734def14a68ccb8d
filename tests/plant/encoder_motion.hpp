#pragma once

#include <array>
#include <cstdint>
#include <numbers>
#include <vector>

#include "plant/sensors/encoder.hpp"

/// Motions with a closed form, and an encoder that follows them through a tick.
namespace drivebench::encoder_motion {

inline constexpr double kTurn_rad = 2.0 * std::numbers::pi;
inline constexpr double kTick_s = 125e-6;
inline constexpr int kSubsteps = 5;
inline constexpr double kTimeTolerance_s = 10e-9;  // of an edge, at constant acceleration

/// Constant acceleration through one tick.
struct Motion {
  double angle_rad;
  double speed_rad_s;
  double acceleration_rad_s2;

  double angle_at(double t) const { return angle_rad + t * (speed_rad_s + 0.5 * acceleration_rad_s2 * t); }
  double speed_at(double t) const { return speed_rad_s + acceleration_rad_s2 * t; }
  /// Starts the next tick where this one ends, in the same turn.
  Motion next() const { return {angle_at(kTick_s), speed_at(kTick_s), acceleration_rad_s2}; }
};

inline std::array<AngleSegment, kSubsteps> segments_of(const Motion& m) {
  std::array<AngleSegment, kSubsteps> segments;
  for (int n = 0; n < kSubsteps; ++n) {
    const double from = n * kTick_s / kSubsteps;
    const double to = (n + 1) * kTick_s / kSubsteps;
    segments[static_cast<std::size_t>(n)] = {.start_s = from,
                                             .duration_s = to - from,
                                             .start_rad = m.angle_at(from),
                                             .end_rad = m.angle_at(to),
                                             .start_rad_s = m.speed_at(from),
                                             .end_rad_s = m.speed_at(to)};
  }
  return segments;
}

inline std::vector<Edge> edges_of(const Encoder& encoder, const Motion& m, std::int64_t turn = 0) {
  std::vector<Edge> edges;
  encoder.for_each_edge(segments_of(m), turn, encoder.count_at(m.angle_rad, turn),
                        [&edges](const Edge& e) { edges.push_back(e); });
  return edges;
}

inline EncoderState start(const Encoder& encoder, double angle_rad, std::int64_t turn = 0) {
  return {.count = encoder.count_at(angle_rad, turn)};
}

inline EncoderState followed(const Encoder& encoder, const Motion& m, std::int64_t turn = 0, Tick tick = 0) {
  EncoderState state = start(encoder, m.angle_rad, turn);
  encoder.follow(state, segments_of(m), tick, turn);
  return state;
}

}  // namespace drivebench::encoder_motion
