#include "clients/reference/preset_fit.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>

#include "clients/link/tcp/tcp_axis.hpp"

namespace drivebench::reference {
namespace {

std::optional<double> parameter(const v1::AxisDescription& axis, std::string_view name) {
  for (const v1::ParameterDescription& row : axis.parameters()) {
    if (row.name() == name) return row.value();
  }
  return std::nullopt;
}

bool differ(double a, double b) noexcept {
  return std::abs(a - b) > 1e-9 * std::abs(b);
}

/// The second motor that the preset drives is that of the axis on the same amplifier.
void add_mismatches_of_second(const v1::BenchDescription& bench, std::uint32_t axis,
                              const control::Requirements& needs, std::vector<std::string>& found) {
  const std::optional<std::uint32_t> number = link::sharer_of_amplifier(bench, axis);
  if (!number) {
    found.emplace_back(
        "the preset drives two motors, but this link shows no axis that shares the amplifier of this one");
    return;
  }
  const v1::AxisDescription& second = bench.axes(static_cast<int>(*number));
  const auto must_equal = [&](std::string_view name, double expected) {
    const std::optional<double> value = parameter(second, name);
    if (!value || !differ(*value, expected)) return;
    found.push_back(fmt::format("{} of axis {} is {:g} on the bench, {:g} in the preset", name, second.name(),
                                *value, expected));
  };
  if (second.machine_kind() != needs.machine_kind) {
    found.push_back(fmt::format("machine.kind of axis {} is {} on the bench, {} in the preset", second.name(),
                                second.machine_kind(), needs.machine_kind));
  }
  must_equal("encoder.counts_per_revolution", needs.counts_per_revolution);
  must_equal("machine.pole_pairs", needs.pole_pairs);
}

/// The sample rate of each preset as it stands, 0 for one that exists to be refused. Runs are dear, so that
/// they are made once.
const std::vector<double>& sample_rates_hz() {
  static const std::vector<double> kRates = [] {
    std::vector<double> rates;
    for (const control::Preset& each : control::presets()) {
      const std::optional<control::Run> run = made_as_it_stands(each);
      rates.push_back(run ? run->timing().sample_rate_hz : 0.0);
    }
    return rates;
  }();
  return kRates;
}

}  // namespace

control::Requirements needs_of(const control::Preset& preset, std::span<const control::Gain> overrides) {
  control::Requirements needs = preset.needs;
  for (const control::Gain& gain : overrides) {
    if (gain.name == "counts_per_revolution") needs.counts_per_revolution = gain.value;
    if (gain.name == "machine.pole_pairs") needs.pole_pairs = gain.value;
    if (gain.name == "voltage_limit_v") needs.voltage_limit_v = gain.value;
  }
  return needs;
}

std::vector<std::string> mismatches(const AxisView& view, const control::Requirements& needs,
                                    double sample_rate_hz) {
  std::vector<std::string> found;
  const v1::AxisDescription& there = view.description();
  const auto must_equal = [&](std::string_view what, std::optional<double> value, double expected) {
    if (value && differ(*value, expected)) {
      found.push_back(fmt::format("{} is {:g} on the bench, {:g} in the preset", what, *value, expected));
    }
  };
  // Links without a description leave the kinds empty.
  const std::string& kind = there.machine_kind();
  if (!kind.empty() && kind != needs.machine_kind && kind != needs.other_kind) {
    found.push_back(
        fmt::format("machine.kind is {} on the bench, {} in the preset", kind, needs.machine_kind));
  }
  const bool wants_currents = needs.quantity == control::Quantity::kCurrent;
  const std::string& drive = there.drive_kind();
  if (!drive.empty() && (drive == "source" || wants_currents != (drive == "current_amplifier"))) {
    found.push_back(fmt::format("drive.kind is {} on the bench, the preset commands {}", drive,
                                wants_currents ? "currents" : "voltages"));
  }
  const Signal* const signal = find_signal(needs.signal);
  if (signal != nullptr && (view.known >> (signal - kSignals.data()) & 1) == 0) {
    found.push_back(fmt::format("the preset measures {}, which this link does not carry", needs.signal));
  }
  must_equal("the sample rate [Hz]", 1.0 / view.bench.period_s(), sample_rate_hz);
  if (needs.counts_per_revolution > 0.0) {
    must_equal("encoder.counts_per_revolution", parameter(there, "encoder.counts_per_revolution"),
               needs.counts_per_revolution);
  }
  if (needs.pole_pairs > 0.0) {
    must_equal("machine.pole_pairs", parameter(there, "machine.pole_pairs"), needs.pole_pairs);
  }
  const std::optional<double> limit_v = parameter(there, "amplifier.voltage_limit_v");
  if (limit_v && *limit_v < needs.voltage_limit_v) {
    found.push_back(fmt::format("amplifier.voltage_limit_v is {:g} on the bench, the preset uses up to {:g}",
                                *limit_v, needs.voltage_limit_v));
  }
  if (needs.drives_second) add_mismatches_of_second(view.bench, view.axis, needs, found);
  return found;
}

std::string misfit_text(const AxisView& view, const control::Preset& preset,
                        std::span<const control::Gain> overrides, double sample_rate_hz) {
  const std::vector<std::string> found = mismatches(view, needs_of(preset, overrides), sample_rate_hz);
  if (found.empty()) return {};
  std::string text = fmt::format("preset {} does not fit this bench:", preset.name);
  for (const std::string& each : found)
    text += "\n  " + each;
  if (view.description().machine_kind().empty()) return text;  // anything would fit
  const std::vector<const control::Preset*> fitting = fitting_presets(view);
  for (const control::Preset* const other : fitting)
    text += fmt::format("\n  {} would fit", other->name);
  if (fitting.empty())
    text +=
        "\n  no other preset fits either: this bench needs a controller of your own, such as own_motor.py";
  return text;
}

void prepare_presets() {
  sample_rates_hz();
}

std::vector<const control::Preset*> fitting_presets(const AxisView& view) {
  std::vector<const control::Preset*> fitting;
  const std::vector<control::Preset>& all = control::presets();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double rate_hz = sample_rates_hz()[i];
    if (rate_hz > 0.0 && mismatches(view, all[i].needs, rate_hz).empty()) fitting.push_back(&all[i]);
  }
  return fitting;
}

std::optional<control::Run> made_as_it_stands(const control::Preset& preset) {
  try {
    return preset.make({});
  } catch (const std::invalid_argument&) {
    return std::nullopt;
  }
}

double counts_per_revolution(const AxisView& view, const control::Requirements& needs) {
  return parameter(view.description(), "encoder.counts_per_revolution").value_or(needs.counts_per_revolution);
}

}  // namespace drivebench::reference
