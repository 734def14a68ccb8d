#include <algorithm>

#include "plant/mechanics/shaft.hpp"

namespace drivebench {
namespace {

enum Event : std::size_t { kRotor, kLoad, kUpperTeeth, kLowerTeeth };

// The value of an event that cannot happen in the branch.
constexpr double kNever = 1.0;

/// The side of the backlash on which the teeth are, or to which they are nearer.
double side_of(const TwoMassState& x) noexcept {
  return x.twist_rad < 0.0 ? -1.0 : 1.0;
}

double twist_speed_rad_s(const ShaftConstants& c, const TwoMassState& x) noexcept {
  return c.per_ratio * x.speed_rad_s - x.load_speed_rad_s;
}

/// The twist of the shaft beyond the backlash; negative within it.
double beyond_rad(const ShaftConstants& c, const TwoMassState& x) noexcept {
  return std::abs(x.twist_rad) - c.half_backlash_rad;
}

/// The torque that presses the teeth together, of spring and damper; negative where they would have to pull.
/// Zero within its own rounding, so that a state settled() at zero is seen as such.
double pressure_nm(const ShaftConstants& c, const TwoMassState& x) noexcept {
  constexpr double kRounding = 0x1p-44;
  const double pressure =
      c.stiffness_nm * beyond_rad(c, x) + c.damping_nms * side_of(x) * twist_speed_rad_s(c, x);
  const double size = c.stiffness_nm * std::abs(x.twist_rad) +
                      c.damping_nms * (std::abs(c.per_ratio * x.speed_rad_s) + std::abs(x.load_speed_rad_s));
  return std::abs(pressure) <= kRounding * size ? 0.0 : pressure;
}

/// Rotor and load under the torque of the shaft: whether they turn, and which way friction acts.
ShaftBranch with_friction(const ShaftConstants& c, const TwoMassState& x, double driving_nm, double load_nm,
                          bool blocked, bool output_blocked, Freed freed, double contact_rad,
                          double contact) noexcept {
  ShaftBranch branch{.contact_rad = contact_rad, .contact = contact};
  const double shaft_nm = shaft_torque_nm(c, x, branch);
  const double rotor_nm = driving_nm - c.per_ratio * shaft_nm;
  branch = shaft_detail::rotor_branch(c, x.speed_rad_s, rotor_nm, blocked, freed.rotor);
  branch.contact_rad = contact_rad;
  branch.contact = contact;
  if (output_blocked) {
    branch.load_turns = 0.0;
  } else if (c.load_dry_nm > 0.0) {
    const double output_nm = shaft_nm - load_nm;
    const double towards = x.load_speed_rad_s != 0.0 ? x.load_speed_rad_s : output_nm;
    const bool stands = !freed.load && x.load_speed_rad_s == 0.0 && std::abs(output_nm) <= c.load_dry_nm;
    branch.load_turns = stands ? 0.0 : 1.0;
    branch.load_direction = stands ? 0.0 : shaft_detail::sign_of(towards);
    branch.load_held_nm = stands ? c.load_dry_nm : 0.0;
  }
  return branch;
}

}  // namespace

ShaftBranch branch_of(const ShaftConstants& c, const TwoMassState& x, double driving_nm, double load_nm,
                      bool blocked, bool output_blocked, Freed freed) noexcept {
  const auto with = [&](double contact_rad, double contact) {
    return with_friction(c, x, driving_nm, load_nm, blocked, output_blocked, freed, contact_rad, contact);
  };
  if (c.half_backlash_rad == 0.0) return with(0.0, 1.0);
  const double beyond = beyond_rad(c, x);
  if (beyond < 0.0) return with(0.0, 0.0);
  const double border_rad = side_of(x) * c.half_backlash_rad;
  const ShaftBranch apart = with(beyond > 0.0 ? border_rad : 0.0, 0.0);
  double pressure = pressure_nm(c, x);
  if (pressure == 0.0) {
    // Just met or about to part: how the pressure goes on decides.
    const TwoMassState slope = derivative(c, x, driving_nm, load_nm, apart);
    pressure = side_of(x) * (c.stiffness_nm * slope.twist_rad + c.damping_nms * twist_speed_rad_s(c, slope));
  }
  return pressure > 0.0 ? with(border_rad, 1.0) : apart;
}

/// Rotor and load: the speed, or where static friction holds the mass what it could still take up.
/// The teeth: within the backlash the ways to its two ends; while they touch the pressure; while they are
/// apart and the shaft has not yet sprung back the pressure and the rest of its way.
int event_values(const ShaftConstants& c, const TwoMassState& x, const ShaftBranch& branch, double driving_nm,
                 double load_nm, std::array<double, 4>& values) noexcept {
  values = {x.speed_rad_s - shaft_detail::ending_speed_rad_s(c), x.load_speed_rad_s, kNever, kNever};
  if (c.hold_nm == 0.0 && c.motion != ShaftMotion::kImposed) values[kRotor] = kNever;
  if (c.load_dry_nm == 0.0) values[kLoad] = kNever;
  const double shaft_nm = shaft_torque_nm(c, x, branch);
  if (branch.held_nm > 0.0) {
    values[kRotor] = branch.held_nm - std::abs(driving_nm - c.per_ratio * shaft_nm);
  }
  if (branch.load_held_nm > 0.0) values[kLoad] = branch.load_held_nm - std::abs(shaft_nm - load_nm);
  if (c.half_backlash_rad == 0.0) return 2;
  if (branch.contact_rad != 0.0) {
    values[kUpperTeeth] = pressure_nm(c, x);
    if (branch.contact == 0.0) values[kLowerTeeth] = beyond_rad(c, x);
  } else {
    values[kUpperTeeth] = x.twist_rad - c.half_backlash_rad;
    values[kLowerTeeth] = x.twist_rad + c.half_backlash_rad;
  }
  return 4;
}

TwoMassState settled(const ShaftConstants& c, const TwoMassState& x, int event) noexcept {
  TwoMassState result = x;
  switch (event) {
    case kRotor:
      result.speed_rad_s = shaft_detail::ending_speed_rad_s(c);
      break;
    case kLoad:
      result.load_speed_rad_s = 0.0;
      break;
    default: {
      // Teeth meet at the end of the backlash on their way outwards; the pressure vanishes on the way back.
      const double outwards_rad_s = side_of(x) * twist_speed_rad_s(c, x);
      const bool parts = event == kUpperTeeth && outwards_rad_s < 0.0;
      const double left_rad = parts ? -c.damping_nms * outwards_rad_s / c.stiffness_nm : 0.0;
      result.twist_rad = side_of(x) * (c.half_backlash_rad + left_rad);
    }
  }
  return result;
}

LoadSide load_side(const ShaftConstants& c, const TwoMassState& x, double turns_rad) noexcept {
  const double angle_rad = c.per_ratio * (turns_rad + x.angle_rad) - x.twist_rad;
  return {
      .angle_rad = angle_rad, .speed_rad_s = x.load_speed_rad_s, .position_m = c.lead_m_per_rad * angle_rad};
}

double energy_j(const ShaftConstants& c, const TwoMassState& x) noexcept {
  const double twisted_rad = std::max(beyond_rad(c, x), 0.0);
  return 0.5 * (c.inertia_kgm2 * x.speed_rad_s * x.speed_rad_s +
                c.load_inertia_kgm2 * x.load_speed_rad_s * x.load_speed_rad_s +
                c.stiffness_nm * twisted_rad * twisted_rad);
}

double losses_w(const ShaftConstants& c, const TwoMassState& x, const ShaftBranch& branch) noexcept {
  const double rotor_nm = c.friction_nms * x.speed_rad_s + c.dry_nm * branch.direction;
  const double load_nms = c.load_friction_nms + c.load_fan_nms2 * std::abs(x.load_speed_rad_s);
  const double load_nm = load_nms * x.load_speed_rad_s + c.load_dry_nm * branch.load_direction;
  // The power into the shaft less that into its spring.
  const double spring_nm = side_of(x) * c.stiffness_nm * std::max(beyond_rad(c, x), 0.0);
  const double shaft_w = (shaft_torque_nm(c, x, branch) - spring_nm) * twist_speed_rad_s(c, x);
  return rotor_nm * x.speed_rad_s + load_nm * x.load_speed_rad_s + shaft_w;
}

}  // namespace drivebench
