#include <array>

#include "clients/control/gains/move_allowance.hpp"
#include "clients/control/math/limits.hpp"
#include "clients/control/presets/presets_families.hpp"
#include "clients/control/synchronous/bldc_controller.hpp"

namespace drivebench::control {
namespace {

/// The motor of problem 10.5.
constexpr BldcMachineModel kMotor = {.pole_pairs = 1.0,
                                     .resistance_ohm = 0.7,
                                     .torque_constant_nm_per_a = 0.5128,
                                     .friction_nms = 0.002,
                                     .inertia_kgm2 = 2e-4};

constexpr BldcParameters servo(double pole_per_s, CommutationBy commutation, Quantity drive,
                               double lead_samples, double voltage_limit_v) noexcept {
  return {.machine = kMotor,
          .sample_rate_hz = 10e3,
          .counts_per_revolution = 4096.0,
          .voltage_limit_v = voltage_limit_v,
          .current_limit_a = 10.0,
          .position = ServoGains::placed(pole_per_s, pole_per_s, pole_per_s),
          .current = {.proportional_v_per_a = 6.0, .integral_v_per_as = 12000.0},
          .speed_observer = SpeedObserverGains::placed(1000.0, 1000.0, kMotor.friction_rate_per_s()),
          .angle_lead_samples = lead_samples,
          .commutation = commutation,
          .drive = drive};
}

constexpr BldcParameters kCurrent = servo(50.0, CommutationBy::kEncoder, Quantity::kCurrent, 0.5, 250.0);
constexpr BldcParameters kHall = servo(50.0, CommutationBy::kHall, Quantity::kCurrent, 0.0, 250.0);
constexpr BldcParameters k200V = servo(50.0, CommutationBy::kEncoder, Quantity::kCurrent, 0.5, 200.0);
/// One tick of delay and half a tick of hold.
constexpr BldcParameters kInverter = servo(50.0, CommutationBy::kEncoder, Quantity::kVoltage, 1.5, 200.0);
constexpr BldcParameters kInverterHall = servo(50.0, CommutationBy::kHall, Quantity::kVoltage, 1.5, 200.0);

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
std::array<Demand, 2> demands(const BldcMachineModel& p, const MoveAllowance& allowed, const Reference& r) {
  const double current_a = (p.inertia_kgm2 * r.acceleration_rad_s2 + p.friction_nms * r.speed_rad_s) /
                           (2.0 * p.torque_constant_nm_per_a);
  return {Demand{"phase voltage", p.resistance_ohm * current_a + p.torque_constant_nm_per_a * r.speed_rad_s,
                 allowed.voltage_v, "V"},
          Demand{"phase current", current_a, allowed.current_a, "A"}};
}

template <const BldcParameters& kP, const TrajectoryParameters& kPath, const MoveAllowance& kAllowed>
constexpr Preset preset(std::string_view name, std::string_view source, std::string_view expectation,
                        std::string_view bench) {
  return {.name = name,
          .source = source,
          .expectation = expectation,
          .bench = bench,
          .needs = {.machine_kind = "bldc",
                    .counts_per_revolution = kP.counts_per_revolution,
                    .pole_pairs = kP.machine.pole_pairs,
                    .voltage_limit_v = kP.voltage_limit_v,
                    .quantity = kP.drive,
                    .signal = kP.commutation == CommutationBy::kHall ? "hall_lines" : ""},
          .gains = [] { return gains_of(kP, kPath, kAllowed, kTiming); },
          .make = [](std::span<const Gain> overrides) -> Run {
            auto [p, path, allowed, timing] = with_gains(std::tuple{kP, kPath, kAllowed, kTiming}, overrides);
            timing.sample_rate_hz = p.sample_rate_hz;
            const auto demands_at = [&machine = p.machine, &limits = allowed, &move = path](double t_s) {
              return demands(machine, limits, trajectory_at(move, t_s));
            };
            refuse(first_exceeded(path.duration_s(), p.period_s(), demands_at));
            return {std::make_unique<BldcController>(p), std::make_shared<CubicMove>(path), timing};
          }};
}

constexpr auto kPresets = std::to_array<Preset>({
    preset<kCurrent, kMove, k250VLimits>("book/10.6",
                                         "Chiasson 2005, problem 10.6: 240 rad with up to 400 rad/s, with "
                                         "the 250 V that this takes; poles -50",
                                         "peak error 0.122 rad, final below 1 mrad", "bldc-servo"),
    preset<kHall, kMove, k250VLimits>("book/10.6-hall", "as book/10.6, sectors from the Hall lines",
                                      "peak error 0.122 rad, final below 1 mrad", "bldc-servo"),
    preset<k200V, kMove, k250VLimits>(
        "book/10.6-200v", "as book/10.6 with the 200 V of the problem, which its emf exceeds",
        "fails: the speed stays below 388.98 rad/s, more than 1 rad behind", "bldc-servo-200v"),
    preset<kInverter, kSlowerMove, k200VLimits>(
        "book/10.6-inverter",
        "as book/10.6 up to 350 rad/s behind a switched inverter, PI control of the phase currents",
        "peak error 0.08 rad, final at most 2 counts", "bldc-inverter"),
    preset<kInverterHall, kSlowerMove, k200VLimits>(
        "book/10.6-inverter-hall", "as book/10.6-inverter, sectors from the Hall lines",
        "peak error 0.08 rad, final at most 2 counts", "bldc-inverter"),
});

}  // namespace

std::span<const Preset> bldc_presets() noexcept {
  return kPresets;
}

}  // namespace drivebench::control
