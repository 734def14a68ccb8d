#include "clients/command/control/control_loop.hpp"

namespace drivebench::command {

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
        &watcher.answered(bench.exchange(sends ? reference::command_for(tick, setpoint, quantity)
                                               : link::AxisCommand{.tick = tick, .gates = v1::GATES_OFF}));
    periods = static_cast<std::int64_t>(sample->tick - tick);
  }
}

}  // namespace drivebench::command
