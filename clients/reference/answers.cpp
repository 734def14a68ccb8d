#include "clients/reference/answers.hpp"

#include <bench.pb.h>

namespace drivebench::reference {

control::Measurement measurement_of(const Sample& s, SignalMask known, const Sample* second) {
  const auto real = [known](SignalMask bit, double value) { return (known & bit) != 0 ? value : 0.0; };
  return {.encoder_count = s.encoder_count,
          .edge_age_s = real(bit_of("edge_age_s"), s.edge_age_s),
          .edge_period_s = real(bit_of("edge_period_s"), s.edge_period_s),
          .hall_lines = (known & bit_of("hall_lines")) != 0 ? s.hall_lines : 0,
          .tachometer_v = real(bit_of("tachometer_v"), s.tachometer_v),
          .i_a_a = s.i_a_a,
          .i_b_a = s.i_b_a,
          .i_c_a = real(bit_of("i_c_a"), s.i_c_a),
          .i_f_a = real(bit_of("i_f_a"), s.i_f_a),
          .second = second == nullptr ? control::Measurement::Second{}
                                      : control::Measurement::Second{.encoder_count = second->encoder_count,
                                                                     .i_a_a = second->i_a_a,
                                                                     .i_b_a = second->i_b_a}};
}

link::AxisCommand command_for(std::uint64_t tick, const control::Setpoint& x, control::Quantity quantity) {
  if (quantity == control::Quantity::kVoltage) {
    return {
        .tick = tick, .gates = v1::GATES_VOLTAGE, .u_a_v = x.a, .u_b_v = x.b, .u_c_v = x.c, .u_f_v = x.field};
  }
  return {
      .tick = tick, .gates = v1::GATES_CURRENT, .i_a_a = x.a, .i_b_a = x.b, .i_c_a = x.c, .i_f_a = x.field};
}

}  // namespace drivebench::reference
