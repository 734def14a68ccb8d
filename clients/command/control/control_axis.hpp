#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clients/control/presets/presets.hpp"
#include "clients/link/common/axis_link.hpp"

/// Checks and prepares an axis for a preset.
namespace drivebench::command {

/// The requirements of a preset with overridden gains: counts_per_revolution, machine.pole_pairs and
/// voltage_limit_v change them.
control::Requirements needs_of(const control::Preset& preset, std::span<const control::Gain> overrides);

/// The reasons why the preset cannot run on this axis, a sentence each; empty: it can. `known` are the
/// signals of the link.
std::vector<std::string> mismatches(const v1::BenchDescription& bench, std::uint32_t axis,
                                    const control::Requirements& needs, double sample_rate_hz,
                                    SignalMask known);

/// Counts of the encoder from the description of the bench, or else from the preset; 0: unknown.
double counts_per_revolution(const v1::BenchDescription& bench, std::uint32_t axis,
                             const control::Requirements& needs);

/// Arms an axis and brings it to rest after an earlier run: gates off for 50 ms of the bench's time, in which
/// the rotor flux of a servo motor decays (in lockstep it would otherwise stay), and longer while the shaft
/// runs out. Does nothing at tick 0 of a bench whose first command arms. Throws UsageError if it still turns
/// after 5 s.
void let_rest(link::AxisLink& bench, double counts_per_revolution);

}  // namespace drivebench::command
