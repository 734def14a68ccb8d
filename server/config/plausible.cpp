#include "server/config/plausible.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "plant/parameters/parameters.hpp"
#include "protocols/document.hpp"

namespace drivebench {
namespace {

/// What a parameter may be without anybody asking.
struct Window {
  std::string_view name;
  double low;
  double high;
};

// From motors for models to those of mills and ships; of an inductance of 5 H few machines have use. The
// windows are wide: they are for units that were mixed up, mH for H or rpm for rad/s, not for judging a
// design.
constexpr auto kInduction = std::to_array<Window>({
    {"machine.pole_pairs", 1, 40},
    {"machine.stator_resistance_ohm", 1e-4, 500},
    {"machine.rotor_resistance_ohm", 1e-4, 500},
    {"machine.stator_inductance_h", 1e-4, 3},
    {"machine.rotor_inductance_h", 1e-4, 3},
    {"machine.mutual_inductance_h", 1e-4, 3},
    {"machine.stator_leakage_h", 1e-6, 0.3},
    {"machine.rotor_leakage_h", 1e-6, 0.3},
});
constexpr auto kPermanentMagnet = std::to_array<Window>({
    {"machine.pole_pairs", 1, 200},
    {"machine.stator_resistance_ohm", 1e-4, 500},
    {"machine.inductance_d_h", 1e-7, 0.5},
    {"machine.inductance_q_h", 1e-7, 0.5},
    {"machine.self_inductance_h", 1e-7, 0.5},
    {"machine.mutual_inductance_h", 0, 0.5},
    {"machine.torque_constant_nm_per_a", 0, 200},
    {"machine.detent_torque_nm", 0, 1e3},
});
// A field winding has many thin turns: its resistance and inductance are those of no other winding.
constexpr auto kFieldWinding = std::to_array<Window>({
    {"machine.pole_pairs", 1, 200},
    {"machine.stator_resistance_ohm", 1e-4, 500},
    {"machine.stator_inductance_h", 1e-6, 3},
    {"machine.armature_resistance_ohm", 1e-4, 500},
    {"machine.armature_inductance_h", 1e-7, 3},
    {"machine.field_resistance_ohm", 1e-4, 1e4},
    {"machine.field_inductance_h", 0, 500},  // 0: a saturation curve stands for it
    {"machine.mutual_inductance_h", 1e-6, 50},
    {"machine.motor_constant", 1e-5, 1e3},
});
constexpr auto kPermanentMagnetDc = std::to_array<Window>({
    {"machine.armature_resistance_ohm", 1e-4, 500},
    {"machine.armature_inductance_h", 1e-7, 3},
    {"machine.torque_constant_nm_per_a", 1e-4, 200},
});
constexpr auto kLinear = std::to_array<Window>({
    {"machine.resistance_ohm", 1e-4, 500},
    {"machine.inductance_h", 1e-8, 3},
    {"machine.flux_density_t", -3, 3},
    {"machine.bar_length_m", 1e-3, 30},
});
constexpr auto kAll = std::to_array<Window>({
    {"mechanics.inertia_kgm2", 1e-9, 1e5},
    {"mechanics.viscous_friction_nms", 0, 100},
    {"mechanics.imposed_speed_rad_s", -3e4, 3e4},
    {"amplifier.voltage_limit_v", 0.1, 1e5},
    {"amplifier.over_current_a", 1e-3, 1e5},
    {"encoder.counts_per_revolution", 4, 1e8},
});

// Below this the transients of currents are so fast, and the leakage so small a difference of large numbers,
// that a digit was lost rather than a machine built.
constexpr double kLeastLeakageFactor = 0.005;

std::span<const Window> windows_of(std::string_view kind) noexcept {
  if (kind == InductionMachine::kKind || kind == SaturatedInductionMachine::kKind) return kInduction;
  if (kind == PmMachine::kKind || kind == BldcMachine::kKind) return kPermanentMagnet;
  if (kind == PmDcMachine::kKind) return kPermanentMagnetDc;
  if (kind == LinearDcMachine::kKind) return kLinear;
  return kFieldWinding;
}

void look_at(std::span<const Window> windows, std::string_view whose, const AxisParameters& p,
             std::vector<Problem>& found) {
  for (const Window& window : windows) {
    const Parameter* const row = find_parameter(p, window.name);
    if (row == nullptr) continue;
    const double value = row->get(p);
    if (value >= window.low && value <= window.high) continue;
    const std::string unit = row->unit == "1" ? std::string() : " " + std::string(row->unit);
    found.push_back({std::string(window.name), "is " + shortest(value) + unit +
                                                   ", which is odd: " + std::string(whose) + " has " +
                                                   shortest(window.low) + " to " + shortest(window.high) +
                                                   unit + "; --allow-odd takes it all the same"});
  }
}

}  // namespace

std::vector<Problem> oddities(const AxisParameters& p) {
  std::vector<Problem> found;
  const std::string_view kind = machine_kind(p);
  look_at(windows_of(kind), "a machine of kind \"" + std::string(kind) + "\"", p, found);
  look_at(kAll, "an axis", p, found);
  std::visit(
      [&](const auto& machine) {
        if constexpr (requires { leakage_factor(machine); }) {
          const double sigma = leakage_factor(machine);
          if (sigma >= kLeastLeakageFactor) return;
          found.push_back({"machine.mutual_inductance_h",
                           "makes the leakage factor sigma = " + shortest(sigma) +
                               ", which is odd: a machine has " + shortest(kLeastLeakageFactor) +
                               " or more; --allow-odd takes it all the same"});
        }
      },
      p.machine);
  return found;
}

}  // namespace drivebench
