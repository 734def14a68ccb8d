#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clients/control/presets/presets.hpp"
#include "clients/link/common/axis_link.hpp"

/// What an axis must be like before a preset runs on it.
namespace drivebench::command {

/// What the preset needs once some of its gains are overridden: those that say what the axis is like
/// (counts_per_revolution, machine.pole_pairs, voltage_limit_v) change it.
control::Requirements needs_of(const control::Preset& preset, std::span<const control::Gain> overrides);

/// What keeps a run from this axis, one sentence each; empty when it fits. `known` is what the link carries.
std::vector<std::string> mismatches(const v1::BenchDescription& bench, std::uint32_t axis,
                                    const control::Requirements& needs, double sample_rate_hz,
                                    SignalMask known);

/// Counts of the encoder: as the bench describes it, or else as the preset expects it; 0: not known.
double counts_per_revolution(const v1::BenchDescription& bench, std::uint32_t axis,
                             const control::Requirements& needs);

/// Arms an axis and brings it to rest after an earlier run: gates off for 50 ms of the bench's time,
/// in which the rotor flux of a servo motor decays to nothing (in lockstep it would otherwise wait there for
/// ever), and longer while the shaft runs out. Does nothing at tick 0 of a bench whose first command arms.
/// Throws UsageError if it still turns after 5 s.
void let_rest(link::AxisLink& bench, double counts_per_revolution);

}  // namespace drivebench::command
