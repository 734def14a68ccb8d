#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <vector>

#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/wound_rotor_controller.hpp"
#include "plant/math/length.hpp"

namespace drivebench::control::wound_rotor_presets {
namespace {

constexpr WoundRotorModel kMotor = {.pole_pairs = 2.0,
                                    .stator_resistance_ohm = 2.0,
                                    .stator_inductance_h = 0.12,
                                    .field_resistance_ohm = 40.0,
                                    .field_inductance_h = 6.0,
                                    .mutual_inductance_h = 0.8,
                                    .friction_nms = 1e-3,
                                    .inertia_kgm2 = 0.02,
                                    .star = true};

/// The emf of 1 A in the field meets the 325 V at 249 rad/s.
constexpr WoundRotorParameters kWeakening = {
    .machine = kMotor,
    .sample_rate_hz = 10e3,
    .counts_per_revolution = 8192.0,
    .voltage_limit_v = 325.0,
    .field_voltage_limit_v = 325.0,
    .current_limit_a = 15.0,
    .field_current_a = 1.0,
    .base_speed_rad_s = 160.0,
    .current = {.bandwidth_per_s = 800.0, .integral_rate_per_s = 80.0},
    .position = ServoGains::placed(60.0, 60.0, 60.0),
    .speed_observer = SpeedObserverGains::placed(800.0, 800.0, kMotor.friction_rate_per_s())};

constexpr TrajectoryParameters kMove = {
    .distance_rad = 100.0, .ramp_up_s = 0.4, .cruise_s = 0.4, .ramp_down_s = 0.4};
/// Up to 350 rad/s.
constexpr TrajectoryParameters kFastMove = {
    .distance_rad = 1050.0, .ramp_up_s = 2.5, .cruise_s = 0.5, .ramp_down_s = 2.5};
constexpr MoveAllowance kLimits = {.voltage_v = 398.0, .current_a = 15.0};
constexpr MoveAllowance kBeyond = {.voltage_v = 1000.0, .current_a = 15.0};
/// The field takes 25 ms.
constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.05, .hold_s = 0.1};

/// Steady currents and voltages of the references, as vectors.
std::array<Demand, 2> demands(const WoundRotorParameters& p, const MoveAllowance& allowed,
                              const Reference& r) {
  const WoundRotorModel& m = p.machine;
  const double field_a =
      p.field_current_a * std::min(1.0, p.base_speed_rad_s / std::max(std::abs(r.speed_rad_s), 1e-9));
  const double i_q_a = (m.inertia_kgm2 * r.acceleration_rad_s2 + m.friction_nms * r.speed_rad_s) /
                       (m.pole_pairs * m.mutual_inductance_h * field_a);
  const double omega_rad_s = m.pole_pairs * r.speed_rad_s;
  return {Demand{"stator voltage",
                 length(omega_rad_s * m.stator_inductance_h * i_q_a,
                        m.stator_resistance_ohm * i_q_a + omega_rad_s * m.mutual_inductance_h * field_a),
                 allowed.voltage_v, "V"},
          Demand{"stator current", i_q_a, allowed.current_a, "A"}};
}

Run run(const WoundRotorParameters& p, const TrajectoryParameters& path, const MoveAllowance& allowed,
        const RunTiming& timing) {
  return cubic_run<WoundRotorController>(p, path, allowed, timing, demands);
}

Preset preset(std::string_view name, std::string_view source, std::string_view expectation,
              const WoundRotorParameters& p, const TrajectoryParameters& path, const MoveAllowance& allowed) {
  return preset_of({name, source, expectation, "wound-rotor-servo"},
                   {.machine_kind = "wound_rotor_synchronous",
                    .counts_per_revolution = p.counts_per_revolution,
                    .pole_pairs = p.machine.pole_pairs,
                    .voltage_limit_v = p.voltage_limit_v,
                    .signal = "i_f_a"},
                   run, p, path, allowed, kTiming);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset("wound-rotor/servo",
             "equations: Chiasson 2005, (6.38) and problem 6.14; machine, move and gains are ours",
             "peak error at most 2 counts of 8192, final at most 1", kWeakening, kMove, kLimits),
      preset("wound-rotor/field-weakening",
             "as wound-rotor/servo up to 350 rad/s, field weakened from 160 rad/s",
             "peak error at most 2 counts, field down to 0.46 A", kWeakening, kFastMove, kLimits),
      preset("wound-rotor/constant-field",
             "as wound-rotor/field-weakening with the field left as it is: a mistake",
             "fails: the emf meets the voltage limit at 249 rad/s",
             with(kWeakening, &WoundRotorParameters::base_speed_rad_s, 1e4), kFastMove, kBeyond),
  };
}

}  // namespace drivebench::control::wound_rotor_presets
