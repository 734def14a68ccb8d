#include "plant/mechanics/shaft.hpp"

#include <algorithm>
#include <limits>
#include <numbers>

namespace drivebench {

bool has_two_masses(const MechanicsParameters& p) noexcept {
  return p.shaft_stiffness_nm > 0.0;
}

bool has_events(const MechanicsParameters& p) noexcept {
  return p.coulomb_friction_nm > 0.0 || p.static_friction_nm > 0.0 || p.passive_load_nm > 0.0 ||
         (has_two_masses(p) && p.backlash_rad > 0.0) || p.motion != ShaftMotion::kFree;
}

double profile_load_nm(const MechanicsParameters& p, double time_s) noexcept {
  return p.load_profile.held(time_s);
}

double fastest_time_constant_s(const MechanicsParameters& p) noexcept {
  const ShaftConstants c = constants_of(p);
  double rate_per_s = c.friction_nms * c.per_inertia;
  if (has_two_masses(p)) {
    // twist'' = -2 d twist' - w0^2 twist: poles of magnitude w0, or real ones if d is larger.
    const double mobility = c.per_ratio * c.per_ratio * c.per_inertia + c.load_per_inertia;
    const double square = c.stiffness_nm * mobility;
    const double decay_per_s = 0.5 * c.damping_nms * mobility;
    const double excess = decay_per_s * decay_per_s - square;
    const double shaft_per_s = excess > 0.0 ? decay_per_s + std::sqrt(excess) : std::sqrt(square);
    rate_per_s = std::max({rate_per_s, shaft_per_s, c.load_friction_nms * c.load_per_inertia});
  }
  return rate_per_s > 0.0 ? 1.0 / rate_per_s : std::numeric_limits<double>::infinity();
}

ShaftConstants constants_of(const MechanicsParameters& p) noexcept {
  const double n = p.gear_ratio;
  ShaftConstants c;
  c.inertia_kgm2 = p.inertia_kgm2;
  c.friction_nms = p.viscous_friction_nms;
  c.dry_nm = p.coulomb_friction_nm;
  c.hold_nm = p.static_friction_nm;
  c.per_ratio = 1.0 / n;
  if (has_two_masses(p)) {
    c.load_inertia_kgm2 = p.load_inertia_kgm2;
    c.load_per_inertia = 1.0 / p.load_inertia_kgm2;
    c.load_friction_nms = p.load_viscous_friction_nms;
    c.load_fan_nms2 = p.fan_torque_nms2;
    c.load_dry_nm = p.passive_load_nm;
    c.stiffness_nm = p.shaft_stiffness_nm;
    c.damping_nms = p.shaft_damping_nms;
    c.half_backlash_rad = 0.5 * p.backlash_rad;
  } else {
    c.inertia_kgm2 += p.load_inertia_kgm2 / (n * n);
    c.friction_nms += p.load_viscous_friction_nms / (n * n);
    c.fan_nms2 = p.fan_torque_nms2 / (n * n * n);
    c.dry_nm += p.passive_load_nm / n;
    c.hold_nm += p.passive_load_nm / n;
  }
  c.per_inertia = 1.0 / c.inertia_kgm2;
  c.motion = p.motion;
  c.imposed_speed_rad_s = p.imposed_speed_rad_s;
  c.imposed_acceleration_rad_s2 = p.imposed_acceleration_rad_s2;
  c.lead_m_per_rad = p.screw_lead_m / (2.0 * std::numbers::pi);
  return c;
}

LoadSide load_side(const ShaftConstants& c, const ShaftState& x, double turns_rad) noexcept {
  const double angle_rad = c.per_ratio * (turns_rad + x.angle_rad);
  return {.angle_rad = angle_rad,
          .speed_rad_s = c.per_ratio * x.speed_rad_s,
          .position_m = c.lead_m_per_rad * angle_rad};
}

double energy_j(const ShaftConstants& c, const ShaftState& x) noexcept {
  return 0.5 * c.inertia_kgm2 * x.speed_rad_s * x.speed_rad_s;
}

double losses_w(const ShaftConstants& c, const ShaftState& x, const ShaftBranch& branch) noexcept {
  const double friction_nms = c.friction_nms + c.fan_nms2 * std::abs(x.speed_rad_s);
  return (friction_nms * x.speed_rad_s + c.dry_nm * branch.direction) * x.speed_rad_s;
}

}  // namespace drivebench
