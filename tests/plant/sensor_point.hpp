#pragma once

#include <cstdint>
#include <vector>

#include "plant/sensors/sensor_bank.hpp"

/// A sensor bank, what there is to measure, and ticks to take it through.
namespace drivebench::sensor_point {

inline constexpr double kTick_s = 100e-6;
inline constexpr std::uint64_t kSeed = 9;
inline constexpr std::uint64_t kNoiseChannel = 32;

/// Every quantity different.
inline constexpr Measurable kPoint{.current_a = {.a = 1.0, .b = 2.0, .c = 3.0, .field = 4.0},
                                   .voltage_v = {.a = 5.0, .b = 6.0, .c = 7.0, .field = 8.0},
                                   .bus_v = 9.0,
                                   .neutral_v = 10.0,
                                   .temperature_k = 11.0,
                                   .angle_rad = 0.5,
                                   .speed_rad_s = 12.0};

inline SensorBank bank_of(const SensorParameters& p, Connection connection = Connection::kStar,
                          int substeps = 10) {
  return {p, connection, kTick_s, kSeed, kNoiseChannel, kTick_s / substeps};
}

/// All sensors, ideal.
inline SensorParameters all_on() {
  SensorParameters p;
  for (AnalogParameters* analog :
       {&p.voltage, &p.neutral, &p.bus, &p.temperature, &p.tachometer.analog, &p.resolver.analog})
    analog->enabled = true;
  p.tachometer.gain_vs_per_rad = 0.1;
  return p;
}

/// A current of phase a, nothing else.
inline Measurable current_point(double current_a) {
  return {.current_a = {.a = current_a}};
}

/// Takes x(t), a function that gives a Measurable, through tick `tick` to `tick` + 1 in these intervals.
template <class X>
void run_tick(const SensorBank& bank, SensorMemory& m, Tick tick, const std::vector<double>& nodes_s, X x) {
  const double start_s = static_cast<double>(tick) * kTick_s;
  for (std::size_t n = 0; n + 1 < nodes_s.size(); ++n)
    bank.follow(m, nodes_s[n], nodes_s[n + 1] - nodes_s[n], x(start_s + nodes_s[n]),
                x(start_s + nodes_s[n + 1]));
  bank.end_tick(m, x(start_s + kTick_s), tick + 1);
}

inline std::vector<double> even_nodes(int substeps) {
  std::vector<double> nodes;
  for (int n = 0; n <= substeps; ++n)
    nodes.push_back(n * (kTick_s / substeps));
  return nodes;
}

}  // namespace drivebench::sensor_point
