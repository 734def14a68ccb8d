#pragma once

#include "clients/control/loop/controller.hpp"
#include "protocols/signals/command.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench {

/// A sample as the controller's measurement, with nothing between them; `second` is that of the axis on the
/// same amplifier.
inline control::Measurement measurement_of(const Sample& s, const Sample& second = {}) {
  return {.encoder_count = s.encoder_count,
          .edge_age_s = s.edge_age_s,
          .edge_period_s = s.edge_period_s,
          .hall_lines = s.hall_lines,
          .tachometer_v = s.tachometer_v,
          .i_a_a = s.i_a_a,
          .i_b_a = s.i_b_a,
          .i_c_a = s.i_c_a,
          .i_f_a = s.i_f_a,
          .second = {.encoder_count = second.encoder_count, .i_a_a = second.i_a_a, .i_b_a = second.i_b_a}};
}

inline PhaseCommand command_of(const control::Setpoint& x, control::Quantity quantity) {
  return {.gates = quantity == control::Quantity::kVoltage ? Gates::kVoltage : Gates::kCurrent,
          .setpoint = {.a = x.a, .b = x.b, .c = x.c, .field = x.field}};
}

}  // namespace drivebench
