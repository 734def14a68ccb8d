#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clients/control/presets/presets.hpp"
#include "protocols/signals/catalogue.hpp"

/// Which reference controller suits which axis of a bench.
namespace drivebench::reference {

/// The requirements of a preset with overridden gains: counts_per_revolution, machine.pole_pairs and
/// voltage_limit_v change them.
control::Requirements needs_of(const control::Preset& preset, std::span<const control::Gain> overrides);

/// An axis of a bench as a link shows it.
struct AxisView {
  const v1::BenchDescription& bench;
  std::uint32_t axis;
  SignalMask known = kAllSignals;  ///< the signals of the link

  const v1::AxisDescription& description() const { return bench.axes(static_cast<int>(axis)); }
};

/// The reasons why the preset cannot run on this axis, a sentence each; empty: it can.
std::vector<std::string> mismatches(const AxisView& view, const control::Requirements& needs,
                                    double sample_rate_hz);

/// The refusal of a preset that does not fit: the reasons and the presets that would fit, a line each.
/// Empty: it fits.
std::string misfit_text(const AxisView& view, const control::Preset& preset,
                        std::span<const control::Gain> overrides, double sample_rate_hz);

/// The presets that fit the axis as they stand. The first call of the program, or prepare_presets(), takes
/// some 0.2 s.
std::vector<const control::Preset*> fitting_presets(const AxisView& view);

void prepare_presets();

/// The run with the preset's own gains; nothing for a preset that exists to be refused.
std::optional<control::Run> made_as_it_stands(const control::Preset& preset);

/// Counts of the encoder from the description of the bench, or else from the preset; 0: unknown.
double counts_per_revolution(const AxisView& view, const control::Requirements& needs);

}  // namespace drivebench::reference
