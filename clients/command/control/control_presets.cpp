#include "clients/command/control/control_presets.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <stdexcept>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/control/control_json.hpp"
#include "protocols/nearest_name.hpp"

namespace drivebench::command {
namespace {

std::string run_text(const control::Preset& preset) {
  const std::optional<control::Run> run = made_as_it_stands(preset);
  if (!run) return "refused as it stands";
  return fmt::format("{:g} s at {:g} kHz", static_cast<double>(run->planned_samples()) * run->period_s(),
                     run->timing().sample_rate_hz / 1e3);
}

void print_gains(const control::Preset& preset, std::span<const control::Gain> overrides) {
  for (const control::Gain& gain : gains_with(preset, overrides))
    fmt::print("  {:<40} {:.9g}\n", gain.name, gain.value);
}

void print_preset(const control::Preset& preset) {
  const control::Requirements& needs = preset.needs;
  fmt::print("{}\n  source    {}\n  expect    {}\n", preset.name, preset.source, preset.expectation);
  fmt::print("  axis      {}, {}, {:g} V, commands {}, bench {}\n", needs.machine_kind, run_text(preset),
             needs.voltage_limit_v, needs.quantity == control::Quantity::kVoltage ? "voltages" : "currents",
             preset.bench);
}

}  // namespace

const control::Preset& chosen_preset(const std::string& name) {
  const control::Preset* const preset = control::find_preset(name);
  if (preset == nullptr) {
    const std::string nearest = did_you_mean(name, control::presets(), &control::Preset::name);
    throw UsageError(fmt::format("no preset '{}'{} --list shows all", name, nearest.empty() ? ";" : nearest));
  }
  return *preset;
}

control::Run made(const control::Preset& preset, std::span<const control::Gain> overrides) {
  try {
    return preset.make(overrides);
  } catch (const std::invalid_argument& error) {
    throw UsageError(fmt::format("preset {}: {}", preset.name, error.what()));
  }
}

std::vector<control::Gain> gains_with(const control::Preset& preset,
                                      std::span<const control::Gain> overrides) {
  std::vector<control::Gain> gains = preset.gains();
  for (const control::Gain& each : overrides) {
    const auto row = std::ranges::find(gains, each.name, &control::Gain::name);
    if (row != gains.end()) row->value = each.value;
  }
  return gains;
}

int run_list(const ControlOptions& options) {
  if (!options.list) {
    const control::Preset& preset = chosen_preset(options.preset);
    if (!options.overrides.empty()) made(preset, options.overrides);  // refuses impossible gains
    if (options.json) {
      fmt::print("{}\n", gains_json(gains_with(preset, options.overrides)));
    } else {
      fmt::print("{}\n", preset.name);
      print_gains(preset, options.overrides);
    }
    return kExitOk;
  }
  if (options.json) {
    fmt::print("{}\n", presets_json());
    return kExitOk;
  }
  for (const control::Preset& preset : control::presets()) {
    print_preset(preset);
    if (options.gains) print_gains(preset, {});
  }
  return kExitOk;
}

}  // namespace drivebench::command
