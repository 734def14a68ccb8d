#include <array>
#include <memory>
#include <numbers>
#include <vector>

#include "clients/control/presets/presets_families.hpp"
#include "clients/control/salient/salient_pm_controller.hpp"
#include "plant/math/length.hpp"

namespace drivebench::control::salient_pm_presets {
namespace {

// The book has an exercise and no numbers: machine, gains and move are ours.

/// A servo motor with buried magnets, 4 pole pairs, L_q 2.3 times L_d.
constexpr SalientPmModel kIpm = {.pole_pairs = 4.0,
                                 .resistance_ohm = 0.35,
                                 .inductance_d_h = 1.8e-3,
                                 .inductance_q_h = 4.2e-3,
                                 .torque_constant_nm_per_a = 0.30,
                                 .friction_nms = 2e-4,
                                 .inertia_kgm2 = 3e-4,
                                 .star = true};

constexpr double kPhase_v = 160.0;
constexpr double kVoltage_v = 195.9;  // √(3/2) of a phase

constexpr SalientPmParameters kServo = {
    .machine = kIpm,
    .sample_rate_hz = 10e3,
    .counts_per_revolution = 4096.0,
    .voltage_limit_v = kVoltage_v,
    .current_limit_a = 20.0,
    .torque_pole_per_s = 2000.0,
    .position = ServoGains::placed(150.0, 150.0, 150.0),
    .speed_observer = SpeedObserverGains::placed(1500.0, 1500.0, 2e-4 / 3e-4)};

/// Five turns in 75 ms, to 314 rad/s: 5.7 N·m, for which i_d = 0 would take 19 A.
constexpr TrajectoryParameters kMove = {
    .distance_rad = 5.0 * std::numbers::pi, .ramp_up_s = 0.025, .cruise_s = 0.025, .ramp_down_s = 0.025};
/// Two turns at 5 rad/s.
constexpr TrajectoryParameters kSlowMove = {
    .distance_rad = 4.0 * std::numbers::pi, .ramp_up_s = 0.1, .cruise_s = 2.4, .ramp_down_s = 0.1};

constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.005, .hold_s = 0.060};
constexpr MoveAllowance kLimits = {.voltage_v = kVoltage_v, .current_a = 20.0};

std::array<Demand, 2> salient_demands(const SalientPmParameters& p, const MoveAllowance& allowed,
                                      const Reference& r) {
  const SalientReferences x = salient_references(p, r);
  const Dq u = salient_voltage_v(p.machine, x, r.speed_rad_s);
  return {Demand{"stator voltage", length(u.d, u.q), allowed.voltage_v, "V"},
          Demand{"stator current", length(x.least.current_a.d, x.least.current_a.q), allowed.current_a, "A"}};
}

Run run(const SalientPmParameters& p, const TrajectoryParameters& path, const MoveAllowance& allowed,
        const RunTiming& timing) {
  return cubic_run<SalientPmController>(p, path, allowed, timing, salient_demands);
}

Preset preset(const PresetText& text, const SalientPmParameters& p, const TrajectoryParameters& path) {
  return preset_of(text,
                   {.machine_kind = "pm_synchronous",
                    .counts_per_revolution = p.counts_per_revolution,
                    .pole_pairs = p.machine.pole_pairs,
                    .voltage_limit_v = kPhase_v},
                   run, p, path, kLimits, kTiming);
}

}  // namespace

std::vector<Preset> all() {
  return {
      preset({"book/9.11",
              "Chiasson 2005, problem 9.11: salient PM machine, linearised torque, the least current "
              "for it; machine, gains and move ours",
              "peak error at most 10 counts of 4096, final at most 1", "ipm-servo"},
             kServo, kMove),
      preset({"book/9.11-quadrature", "book/9.11 with i_d = 0, which gives the torque of the saliency away",
              "tracks as well, with more current", "ipm-servo"},
             with(kServo, &SalientPmParameters::current, SalientCurrent::kQuadrature), kMove),
      preset({"book/9.11-detent", "book/9.11 at 5 rad/s, where the detent torque is felt 16 times a turn",
              "the error that the gains leave of 0.05 N*m at 80 rad/s", "ipm-servo"},
             kServo, kSlowMove),
  };
}

}  // namespace drivebench::control::salient_pm_presets
