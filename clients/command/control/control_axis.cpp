#include "clients/command/control/control_axis.hpp"

#include <fmt/core.h>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/reference/rest.hpp"

namespace drivebench::command {

void let_rest(link::AxisLink& bench, double counts_per_revolution) {
  using reference::Rest;
  const Sample* sample = &bench.newest();
  if (Rest::is_needless(bench.bench(), *sample)) return;
  Rest rest(bench.bench().period_s(), counts_per_revolution, bench.known());
  Rest::State state = rest.see(*sample, bench.second());
  while (state == Rest::State::kGoesOn && !interrupted()) {
    sample = &bench.exchange({.tick = sample->tick, .gates = v1::GATES_OFF});
    state = rest.see(*sample, bench.second());
  }
  if (state != Rest::State::kTurns) return;
  throw UsageError(
      fmt::format("the shaft turns at {:.3g} rad/s; the run starts from rest", rest.speed_rad_s()));
}

}  // namespace drivebench::command
