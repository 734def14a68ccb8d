#include "clients/command/control/control_loop.hpp"

namespace drivebench::command {
namespace {

consteval SignalMask bit_of(std::string_view name) {
  return SignalMask{1} << (find_signal(name) - kSignals.data());
}

link::AxisCommand command_for(std::uint64_t tick, const control::Setpoint& x, control::Quantity quantity) {
  if (quantity == control::Quantity::kVoltage) {
    return {
        .tick = tick, .gates = v1::GATES_VOLTAGE, .u_a_v = x.a, .u_b_v = x.b, .u_c_v = x.c, .u_f_v = x.field};
  }
  return {
      .tick = tick, .gates = v1::GATES_CURRENT, .i_a_a = x.a, .i_b_a = x.b, .i_c_a = x.c, .i_f_a = x.field};
}

}  // namespace

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

void control_loop(link::AxisLink& bench, control::Run& run, LoopWatcher& watcher) {
  const control::Quantity quantity = run.controller().quantity();
  const Sample* sample = &bench.newest();
  std::int64_t periods = 1;
  for (;;) {
    const control::Measurement measured = measurement_of(*sample, bench.known(), bench.second());
    const control::Setpoint setpoint = run.step(measured, periods);
    const std::uint64_t tick = sample->tick;
    const Answer answer = watcher.answering(
        {.sample = *sample, .measured = measured, .setpoint = setpoint, .periods = periods});
    if (answer == Answer::kEnd) return;
    const bool sends = answer == Answer::kSend;
    sample =
        &watcher.answered(bench.exchange(sends ? command_for(tick, setpoint, quantity)
                                               : link::AxisCommand{.tick = tick, .gates = v1::GATES_OFF}));
    periods = static_cast<std::int64_t>(sample->tick - tick);
  }
}

}  // namespace drivebench::command
