#include "clients/identification/named_experiments.hpp"

#include <algorithm>
#include <array>

namespace drivebench::identification {
namespace {

constexpr std::array<NamedExperiment, 12> kExperiments = {{
    {.motor = "im",
     .name = "dol-start",
     .file = "im-8-5-5-start",
     .bench = "im-8-5-5",
     .summary = "direct-on-line start of 8.5.5 under 3.7 N*m, 0.2 s at 4 kHz",
     .load = LoadModel::kConstant,
     .from_s = 0.005},
    {.motor = "im",
     .name = "no-load-start",
     .file = "im-8-5-6-start",
     .bench = "im-8-5-6",
     .summary = "direct-on-line start of 8.5.6 without load, 0.6 s at 4 kHz",
     .from_s = 0.005},
    {.motor = "im",
     .name = "dc-resistance",
     .file = "im-b-dc-resistance",
     .bench = "im-b",
     .summary = "8 V of DC through two phases in series, 2.5 s: R_S",
     .from_s = 2.0,
     .test = TerminalTest::kDcResistance},
    {.motor = "im",
     .name = "no-load",
     .file = "im-b-no-load",
     .bench = "im-b",
     .summary = "problem 7.19: 208 V, 60 Hz, the shaft free, 3 s: L_S",
     .from_s = 2.4,
     .test = TerminalTest::kNoLoad},
    {.motor = "im",
     .name = "blocked-rotor",
     .file = "im-b-blocked-rotor",
     .bench = "im-b",
     .summary = "problem 7.19: a third of 208 V, 60 Hz, the shaft held, 1 s: R_R, L_S - M",
     .from_s = 0.7,
     .test = TerminalTest::kBlockedRotor},
    {.motor = "im",
     .name = "classical",
     .file = "im-b-dc-resistance",
     .bench = "im-b",
     .summary = "these three in turn: all parameters, with what the way of the book makes wrong in them",
     .test = TerminalTest::kAll},
    {.motor = "dc",
     .name = "voltage-steps",
     .file = "dc-a-steps",
     .bench = "dc-a-voltage",
     .summary = "8 V switched by a shift register behind a voltage amplifier, 1 s at 10 kHz"},
    {.motor = "dc",
     .name = "two-sines",
     .file = "dc-a-two-sines-100khz",
     .bench = "dc-a-100khz",
     .summary = "problem 2.28: 2.5 A at 10 and 20 Hz, 1 s kept at 1 kHz"},
    {.motor = "pm",
     .name = "swing",
     .file = "pm-swing",
     .bench = "pm-9-3",
     .summary = "sines of u_q and u_d, both ways, 0.5 s at 50 kHz",
     .current_hz = 200.0,
     .voltage_hz = 200.0,
     .shaft_hz = 200.0},
    {.motor = "pm",
     .name = "ramp",
     .file = "pm-ramp",
     .bench = "pm-9-3",
     .summary = "section 9.3: u_q from 1 to 6 V in 20 ms, 30 ms at 50 kHz",
     .from_s = 0.005,
     .current_hz = 200.0,
     .voltage_hz = 200.0,
     .shaft_hz = 200.0},
    {.motor = "pm",
     .name = "salient-swing",
     .file = "ipm-swing",
     .bench = "ipm-servo",
     .summary = "buried magnets: sines of u_q and u_d, both ways, 1 s at 10 kHz"},
    {.motor = "bldc",
     .name = "swing",
     .file = "bldc-swing",
     .bench = "bldc-servo",
     .summary = "25 V and a swing of 12 V that turn with the motor, 1 s at 10 kHz",
     .from_s = 0.02,
     .shaft_hz = 300.0},
}};

}  // namespace

std::span<const NamedExperiment> named_experiments() noexcept {
  return kExperiments;
}

const NamedExperiment* find_experiment(std::string_view motor, std::string_view name) noexcept {
  for (const NamedExperiment& each : kExperiments) {
    if (each.motor == motor && each.name == name) return &each;
  }
  return nullptr;
}

const NamedExperiment* first_experiment(std::string_view motor) noexcept {
  const auto found = std::ranges::find(kExperiments, motor, &NamedExperiment::motor);
  return found == kExperiments.end() ? nullptr : &*found;
}

const NamedExperiment& experiment_of(TerminalTest test) noexcept {
  return *std::ranges::find(kExperiments, test, &NamedExperiment::test);
}

std::string experiment_names(std::string_view motor) {
  std::string names;
  for (const NamedExperiment& each : kExperiments) {
    if (each.motor == motor) names += (names.empty() ? "" : ", ") + std::string(each.name);
  }
  return names;
}

void apply(const NamedExperiment& named, Settings& settings) noexcept {
  settings.load = named.load;
  settings.processing.from_s = named.from_s;
  settings.processing.to_s = named.to_s;
  const auto set = [](LowPass& filter, double corner_hz) {
    if (corner_hz > 0.0) filter.cutoff_hz = corner_hz;
  };
  set(settings.processing.current, named.current_hz);
  set(settings.processing.voltage, named.voltage_hz);
  set(settings.processing.shaft, named.shaft_hz);
}

}  // namespace drivebench::identification
