#include "clients/command/control/control_replay.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/control/control_loop.hpp"

namespace drivebench::command {

void answer_recorded(const RecordedRun& recorded, control::Run& run,
                     const std::function<void(const Answered&, const control::Setpoint&)>& see) {
  const double rate_hz = run.timing().sample_rate_hz;
  if (std::abs(recorded.period_s * rate_hz - 1.0) > 1e-6) {
    throw UsageError(fmt::format("the recording is sampled at {:g} Hz, the preset at {:g} Hz",
                                 1.0 / recorded.period_s, rate_hz));
  }
  std::uint64_t last_tick = recorded.rows.front().sample.tick;
  for (const Answered& row : recorded.rows) {
    const std::uint64_t tick = row.sample.tick;
    const auto periods = std::max<std::int64_t>(1, static_cast<std::int64_t>(tick - last_tick));
    last_tick = tick;
    const control::Setpoint setpoint =
        run.step(measurement_of(row.sample, kAllSignals, recorded.second_at(tick)), periods);
    if (run.done()) return;
    see(row, setpoint);
  }
}

}  // namespace drivebench::command
