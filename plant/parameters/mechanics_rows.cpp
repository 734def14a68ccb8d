#include "plant/parameters/mechanics_rows.hpp"

#include <array>
#include <string_view>
#include <utility>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Shaft = MechanicsParameters;

constexpr auto kMotions = std::to_array<std::string_view>({"free", "locked", "imposed"});

template <auto Member>
constexpr Parameter shaft_row(std::string_view name, std::string_view unit, double minimum, double maximum,
                              unsigned traits, std::string_view meaning, Range usual = {}) {
  return row<&AxisParameters::mechanics, Member>(name, unit, minimum, maximum, traits, meaning, usual);
}

constexpr auto kMechanicsTable = std::to_array<Parameter>({
    shaft_row<&Shaft::inertia_kgm2>("mechanics.inertia_kgm2", "kg*m^2", 1e-12, 1e9, kLive | kRequired,
                                    "J of the rotor and all that turns with it", {1e-9, 1e5}),
    shaft_row<&Shaft::viscous_friction_nms>("mechanics.viscous_friction_nms", "N*m*s/rad", 0, 1e6, kLive,
                                            "f, friction torque over speed", {0, 100}),
    shaft_row<&Shaft::coulomb_friction_nm>("mechanics.coulomb_friction_nm", "N*m", 0, 1e6, kLive,
                                           "friction torque that opposes motion"),
    shaft_row<&Shaft::static_friction_nm>(
        "mechanics.static_friction_nm", "N*m", 0, 1e6, kLive,
        "torque that holds a standing shaft; at least the Coulomb friction"),
    shaft_row<&Shaft::fan_torque_nms2>("mechanics.fan_torque_nms2", "N*m*s^2/rad^2", 0, 1e6, kLive,
                                       "k of a fan or pump at the output: k w|w| opposes motion"),
    shaft_row<&Shaft::passive_load_nm>(
        "mechanics.passive_load_nm", "N*m", 0, 1e6, kLive,
        "opposes motion at the output and holds at standstill, as a brake does"),
    shaft_row<&Shaft::gear_ratio>("mechanics.gear_ratio", "1", 1e-6, 1e6, kReal,
                                  "n: turns of the motor for one of the output; loads act at the output"),
    shaft_row<&Shaft::load_inertia_kgm2>(
        "mechanics.load_inertia_kgm2", "kg*m^2", 0, 1e9, kLive,
        "at the output; m (screw_lead_m/(2 pi))^2 for a table of mass m on a screw"),
    shaft_row<&Shaft::load_viscous_friction_nms>("mechanics.load_viscous_friction_nms", "N*m*s/rad", 0, 1e6,
                                                 kLive, "at the output"),
    shaft_row<&Shaft::shaft_stiffness_nm>("mechanics.shaft_stiffness_nm", "N*m/rad", 0, 1e12, kReal,
                                          "of the shaft from gear to load_inertia_kgm2; 0: rigid"),
    shaft_row<&Shaft::shaft_damping_nms>("mechanics.shaft_damping_nms", "N*m*s/rad", 0, 1e9, kLive,
                                         "torque over speed of the twist of an elastic shaft"),
    shaft_row<&Shaft::backlash_rad>("mechanics.backlash_rad", "rad", 0, 6.3, kReal,
                                    "whole free play at the output, ahead of an elastic shaft"),
    shaft_row<&Shaft::screw_lead_m>("mechanics.screw_lead_m", "m", 0, 1e3, kReal,
                                    "way of the table for one turn of the output; 0: no screw"),
    choice(shaft_row<&Shaft::motion>(
               "mechanics.motion", "1", 0, 0, kLive,
               "free: the torques decide; locked: the rotor stands; imposed: a prime mover drives it"),
           kMotions),
    shaft_row<&Shaft::imposed_speed_rad_s>("mechanics.imposed_speed_rad_s", "rad/s", -1e6, 1e6, kLive,
                                           "speed of the rotor to which the prime mover goes", {-3e4, 3e4}),
    shaft_row<&Shaft::imposed_acceleration_rad_s2>("mechanics.imposed_acceleration_rad_s2", "rad/s^2", 1e-6,
                                                   1e12, kLive, "at which it goes there"),
});

constexpr auto kMechanicsCurves = std::to_array<CurveParameter>({
    {.name = "mechanics.load_profile",
     .x_unit = "s",
     .y_unit = "N*m",
     .required = false,
     .rising = false,
     .meaning = "active load at the output over time since tick 0, added to that of the clients; beyond its "
                "ends the end value",
     .get = [](const AxisParameters& p) noexcept -> const Curve& { return p.mechanics.load_profile; },
     .set = [](AxisParameters& p, Curve curve) { p.mechanics.load_profile = std::move(curve); }},
});

}  // namespace

std::span<const Parameter> mechanics_rows() noexcept {
  return kMechanicsTable;
}

std::span<const CurveParameter> mechanics_curves() noexcept {
  return kMechanicsCurves;
}

void add_problems(const MechanicsParameters& p, Problems& found) {
  if (p.static_friction_nm < p.coulomb_friction_nm) {
    found.add("mechanics.static_friction_nm", [&] {
      return "is " + text(p.static_friction_nm) +
             " but must not be below coulomb_friction_nm = " + text(p.coulomb_friction_nm);
    });
  }
  if (has_two_masses(p)) {
    if (p.load_inertia_kgm2 == 0.0) {
      found.add("mechanics.load_inertia_kgm2", [&] {
        return "is 0 but must be above 0 at the end of an elastic shaft: shaft_stiffness_nm is " +
               text(p.shaft_stiffness_nm);
      });
    }
    return;
  }
  const auto needs_stiffness = [&found](const char* field, double value) {
    if (!(value > 0.0)) return;
    found.add(field, [&] {
      return "is " + text(value) +
             " but must be 0 on a rigid shaft: an elastic one has shaft_stiffness_nm above 0";
    });
  };
  needs_stiffness("mechanics.shaft_damping_nms", p.shaft_damping_nms);
  needs_stiffness("mechanics.backlash_rad", p.backlash_rad);
}

}  // namespace drivebench
