#include "plant/parameters/field_winding_rows.hpp"

namespace drivebench::field_winding_rows {
namespace {

constexpr double kSmallest_h = 1e-9;

}  // namespace

void add_problems(double field_inductance_h, const Curve& saturation_curve, Problems& found) {
  if (saturation_curve.empty()) {
    if (field_inductance_h < kSmallest_h) {
      found.add("machine.field_inductance_h", [&] {
        return "is " + text(field_inductance_h) + " but must be at least " + text(kSmallest_h) +
               " H without a machine.saturation_curve";
      });
    }
    return;
  }
  if (field_inductance_h != 0.0) {
    found.add("machine.field_inductance_h", [&] {
      return "is " + text(field_inductance_h) + " but must be 0 with a machine.saturation_curve";
    });
  }
  if (const CurvePoint first = saturation_curve.points().front(); first != CurvePoint{0.0, 0.0}) {
    found.add("machine.saturation_curve", [&] {
      return "begins at (" + text(first.x) + ", " + text(first.y) + ") but must begin at (0, 0)";
    });
  }
}

}  // namespace drivebench::field_winding_rows
