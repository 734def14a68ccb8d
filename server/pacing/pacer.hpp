#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/config/config.hpp"

namespace drivebench {

/// Paces the ticks of a run; the only place where wall time enters a run.
class Pacer {
 public:
  virtual ~Pacer() = default;
  /// Waits until the next tick is due and returns the lateness [ns]; the first call sets time zero.
  virtual std::int64_t wait() noexcept = 0;
  /// Makes the time of the due tick the new time zero.
  virtual void resynchronise() noexcept = 0;
  /// The time on CLOCK_MONOTONIC at which the tick of the last wait() was due [ns]; 0 without a clock.
  virtual std::int64_t due_ns() const noexcept { return 0; }
  /// The same moment in UTC since 1970 [ns], by the wall clock when time zero was set; 0 without a clock.
  virtual std::int64_t due_unix_ns() const noexcept { return 0; }
};

/// A pacer with absolute deadlines on CLOCK_MONOTONIC. `sleep` relies on the kernel's timer; `sleep+spin`
/// wakes earlier and polls the clock for the last 30 us.
std::unique_ptr<Pacer> make_realtime_pacer(PacerKind kind, std::int64_t period_ns);

/// A pacer that never waits.
std::unique_ptr<Pacer> make_free_pacer();

/// Asks for real-time scheduling, CPU and locked memory for this thread. Returns a sentence for each refusal
/// of the system.
std::vector<std::string> enter_realtime(const RealtimeConfig& config);

}  // namespace drivebench
