#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "plant/drive/drive.hpp"

/// Windings of resistance and inductance on a drive: what the tests of the drive use for a machine.
namespace drivebench {

inline constexpr double kRigTick_s = 100e-6;

using Phases = std::array<double, 3>;

inline Phases phase_array(const ThreePhase& x) {
  return {x.a, x.b, x.c};
}
inline PhaseValues phase_values(const Phases& x) {
  return {.a = x[0], .b = x[1], .c = x[2]};
}
inline PhaseCommand volts(double a, double b = 0.0, double c = 0.0, double field = 0.0) {
  return {.gates = Gates::kVoltage, .setpoint = {.a = a, .b = b, .c = c, .field = field}};
}
inline PhaseCommand amperes(double a, double b = 0.0, double c = 0.0, double field = 0.0) {
  return {.gates = Gates::kCurrent, .setpoint = {.a = a, .b = b, .c = c, .field = field}};
}

/// An amplifier of 100 V without any special features.
inline DriveParameters plain_drive(DriveKind kind = DriveKind::kVoltage) {
  DriveParameters p;
  p.kind = kind;
  p.amplifier.voltage_limit_v = 100.0;
  p.amplifier.over_current_a = 10.0;
  return p;
}

struct RigLoad {
  double resistance_ohm = 1.0;
  double inductance_h = 10e-3;
  Phases emf_v{};
};

/// A drive with its memory and equal windings, each between two legs or all in a star.
struct DriveRig {
  Drive drive;
  DriveMemory memory;
  Connection connection;
  RigLoad load;
  int substeps;
  Tick now = 0;
  Phases current_a{};
  // Since the start:
  Phases volt_seconds{};  ///< of the terminals; in a star against the middle of the link
  Phases charge_as{};     ///< through the terminals
  double energy_j = 0.0;  ///< into the terminals
  double lowest_a = 0.0;  ///< of phase a at the ends of the intervals
  double highest_a = 0.0;

  DriveRig(const DriveParameters& p, Connection c, RigLoad l = {}, int substeps_per_tick = 10)
      : drive(p, c, kRigTick_s, 1, 0),
        memory(drive.initial()),
        connection(c),
        load(l),
        substeps(substeps_per_tick) {}

  void tick(const PhaseCommand& command, const InjectedFaults& faults = {}) {
    drive.begin_tick(memory, command, faults, now++);
    run_tick();
  }

  void run_tick() {
    for (int n = 0; n < substeps; ++n) {
      const double end_s = (n + 1) * kRigTick_s / substeps;
      for (double start_s = n * kRigTick_s / substeps; start_s < end_s;) {
        const double stop_s = std::min(end_s, drive.next_edge_s(memory, start_s));
        interval(start_s, stop_s - start_s);
        start_s = stop_s;
      }
    }
  }

 private:
  std::size_t count() const { return static_cast<std::size_t>(terminal_count(connection)); }

  /// Terminal voltages: of diodes against the current, none without it.
  Phases held(const TerminalDrive& drive_now, const ThreePhase& driven_v) const {
    Phases v = phase_array(driven_v);
    for (std::size_t k = 0; k < count(); ++k) {
      if (drive_now.mode[k] == TerminalMode::kDriven) continue;
      v[k] =
          current_a[k] == 0.0 ? load.emf_v[k] : (current_a[k] > 0.0 ? -drive_now.rail_v : drive_now.rail_v);
    }
    return v;
  }

  Phases slope(const Phases& v, const Phases& i) const {
    double neutral_v = 0.0;
    for (std::size_t k = 0; k < count() && connection == Connection::kStar; ++k)
      neutral_v += (v[k] - load.emf_v[k]) / 3.0;
    Phases result{};
    for (std::size_t k = 0; k < count(); ++k)
      result[k] = (v[k] - neutral_v - load.emf_v[k] - load.resistance_ohm * i[k]) / load.inductance_h;
    return result;
  }

  static Phases moved(const Phases& x, double by, const Phases& slope) {
    return {x[0] + by * slope[0], x[1] + by * slope[1], x[2] + by * slope[2]};
  }

  void interval(double start_s, double duration_s) {
    const PhaseValues from = phase_values(current_a);
    const TerminalDrive now_driven = drive.at(memory, start_s, duration_s, from);
    const Phases start_v = held(now_driven, now_driven.start_v);
    const Phases middle_v = now_driven.constant ? start_v : held(now_driven, now_driven.middle_v);
    const Phases end_v = now_driven.constant ? start_v : held(now_driven, now_driven.end_v);
    const Phases before = current_a;
    const Phases k1 = slope(start_v, before);
    const Phases k2 = slope(middle_v, moved(before, 0.5 * duration_s, k1));
    const Phases k3 = slope(middle_v, moved(before, 0.5 * duration_s, k2));
    const Phases k4 = slope(end_v, moved(before, duration_s, k3));
    Phases mean_v{};
    for (std::size_t k = 0; k < count(); ++k) {
      current_a[k] += duration_s / 6.0 * (k1[k] + 2.0 * k2[k] + 2.0 * k3[k] + k4[k]);
      const bool driven = now_driven.mode[k] == TerminalMode::kDriven;
      if (!driven && connection != Connection::kStar && current_a[k] * before[k] <= 0.0) current_a[k] = 0.0;
      mean_v[k] = (start_v[k] + 4.0 * middle_v[k] + end_v[k]) / 6.0;
      volt_seconds[k] += duration_s * mean_v[k];
      charge_as[k] += 0.5 * duration_s * (before[k] + current_a[k]);
      energy_j += 0.5 * duration_s * mean_v[k] * (before[k] + current_a[k]);
    }
    drive.finish(memory, start_s, duration_s, now_driven, phase_values(mean_v), from,
                 phase_values(current_a));
    lowest_a = std::min(lowest_a, current_a[0]);
    highest_a = std::max(highest_a, current_a[0]);
  }
};

}  // namespace drivebench
