#pragma once

#include "plant/parameters/rows.hpp"

/// The common rows of the tables of the DC machines with a field winding.
namespace drivebench::field_winding_rows {

template <class Kind>
constexpr Parameter armature_resistance() {
  return machine_row<Kind, &Kind::armature_resistance_ohm>("machine.armature_resistance_ohm", "ohm", 1e-6,
                                                           1e6, kLive | kRequired, "R, brushes included",
                                                           {1e-4, 500});
}

template <class Kind>
constexpr Parameter armature_inductance() {
  return machine_row<Kind, &Kind::armature_inductance_h>("machine.armature_inductance_h", "H", 1e-9, 1e3,
                                                         kRequired, "L", {1e-7, 3});
}

template <class Kind>
constexpr Parameter motor_constant() {
  return machine_row<Kind, &Kind::motor_constant>(
      "machine.motor_constant", "1", 1e-9, 1e9, kLive | kRequired,
      "K_m, torque over the product of field flux linkage and armature current", {1e-5, 1e3});
}

template <class Kind>
constexpr Parameter field_resistance() {
  return machine_row<Kind, &Kind::field_resistance_ohm>("machine.field_resistance_ohm", "ohm", 1e-6, 1e6,
                                                        kLive | kRequired, "R_f of the field winding",
                                                        {1e-4, 1e4});
}

template <class Kind>
constexpr Parameter field_inductance() {
  return machine_row<Kind, &Kind::field_inductance_h>(
      "machine.field_inductance_h", "H", 0, 1e4, kReal,
      "L_f of a machine that does not saturate; 0: machine.saturation_curve says what it is", {0, 500});
}

template <class Kind>
constexpr CurveParameter saturation_curve() {
  return {"machine.saturation_curve",
          "A",
          "Wb",
          false,
          true,
          "field flux linkage over field current from (0, 0) on; the same with both signs changed",
          [](const AxisParameters& p) noexcept -> const Curve& {
            return std::get_if<Kind>(&p.machine)->saturation_curve;
          },
          [](AxisParameters& p, Curve curve) {
            std::get_if<Kind>(&p.machine)->saturation_curve = std::move(curve);
          }};
}

/// One of L_f and saturation curve, and the curve from (0, 0) on.
void add_problems(double field_inductance_h, const Curve& saturation_curve, Problems& found);

}  // namespace drivebench::field_winding_rows
