#include <array>
#include <vector>

#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/bldc_controller.hpp"

namespace drivebench::control::bldc_presets {
namespace {

/// The motor of problem 10.5.
constexpr BldcMachineModel kMotor = {.pole_pairs = 1.0,
                                     .resistance_ohm = 0.7,
                                     .torque_constant_nm_per_a = 0.5128,
                                     .friction_nms = 0.002,
                                     .inertia_kgm2 = 2e-4};

constexpr BldcParameters kServo = {
    .machine = kMotor,
    .sample_rate_hz = 10e3,
    .counts_per_revolution = 4096.0,
    .voltage_limit_v = 250.0,
    .current_limit_a = 10.0,
    .position = ServoGains::placed(50.0, 50.0, 50.0),
    .current = {.proportional_v_per_a = 6.0, .integral_v_per_as = 12000.0},
    .speed_observer = SpeedObserverGains::placed(1000.0, 1000.0, kMotor.friction_rate_per_s())};
constexpr BldcParameters k200V = with(kServo, &BldcParameters::voltage_limit_v, 200.0);
/// One tick of delay and half a tick of hold.
constexpr BldcParameters kInverter =
    with(k200V, &BldcParameters::drive, Quantity::kVoltage, &BldcParameters::angle_lead_samples, 1.5);

/// 240 rad in 1.1 s, 400 rad/s reached in 0.5 s.
constexpr TrajectoryParameters kMove = {
    .distance_rad = 240.0, .ramp_up_s = 0.5, .cruise_s = 0.1, .ramp_down_s = 0.5};
/// The same times up to 350 rad/s, which 200 V allow.
constexpr TrajectoryParameters kSlowerMove = {
    .distance_rad = 210.0, .ramp_up_s = 0.5, .cruise_s = 0.1, .ramp_down_s = 0.5};

constexpr MoveAllowance k250VLimits = {.voltage_v = 250.0, .current_a = 10.0};
constexpr MoveAllowance k200VLimits = {.voltage_v = 200.0, .current_a = 10.0};
constexpr RunTiming kTiming = {.sample_rate_hz = 10e3, .prepare_s = 0.01, .hold_s = 0.3};

/// The steady demand of a phase: R_S·I_p + e_p·ω.
std::array<Demand, 2> demands(const BldcParameters& servo, const MoveAllowance& allowed, const Reference& r) {
  const BldcMachineModel& p = servo.machine;
  const double current_a = (p.inertia_kgm2 * r.acceleration_rad_s2 + p.friction_nms * r.speed_rad_s) /
                           (2.0 * p.torque_constant_nm_per_a);
  return {Demand{"phase voltage", p.resistance_ohm * current_a + p.torque_constant_nm_per_a * r.speed_rad_s,
                 allowed.voltage_v, "V"},
          Demand{"phase current", current_a, allowed.current_a, "A"}};
}

Run run(const BldcParameters& p, const TrajectoryParameters& path, const MoveAllowance& allowed,
        const RunTiming& timing) {
  return cubic_run<BldcController>(p, path, allowed, timing, demands);
}

Preset preset(const PresetText& text, const BldcParameters& p, const TrajectoryParameters& path,
              const MoveAllowance& allowed) {
  return preset_of(text,
                   {.machine_kind = "bldc",
                    .counts_per_revolution = p.counts_per_revolution,
                    .pole_pairs = p.machine.pole_pairs,
                    .voltage_limit_v = p.voltage_limit_v,
                    .quantity = p.drive,
                    .signal = p.commutation == CommutationBy::kHall ? "hall_lines" : ""},
                   run, p, path, allowed, kTiming);
}

}  // namespace

std::vector<Preset> all() {
  using P = BldcParameters;
  return {
      preset({"book/10.6",
              "Chiasson 2005, problem 10.6: 240 rad with up to 400 rad/s, with the 250 V that this takes; "
              "poles -50",
              "peak error 0.122 rad, final below 1 mrad", "bldc-servo"},
             kServo, kMove, k250VLimits),
      preset({"book/10.6-hall", "as book/10.6, sectors from the Hall lines",
              "peak error 0.122 rad, final below 1 mrad", "bldc-servo"},
             with(kServo, &P::commutation, CommutationBy::kHall, &P::angle_lead_samples, 0.0), kMove,
             k250VLimits),
      preset({"book/10.6-200v", "as book/10.6 with the 200 V of the problem, which its emf exceeds",
              "fails: the speed stays below 388.98 rad/s, more than 1 rad behind", "bldc-servo-200v"},
             k200V, kMove, k250VLimits),
      preset({"book/10.6-inverter",
              "as book/10.6 up to 350 rad/s behind a switched inverter, PI control of the phase currents",
              "peak error 0.08 rad, final at most 2 counts", "bldc-inverter"},
             kInverter, kSlowerMove, k200VLimits),
      preset({"book/10.6-inverter-hall", "as book/10.6-inverter, sectors from the Hall lines",
              "peak error 0.08 rad, final at most 2 counts", "bldc-inverter"},
             with(kInverter, &P::commutation, CommutationBy::kHall), kSlowerMove, k200VLimits),
  };
}

}  // namespace drivebench::control::bldc_presets
