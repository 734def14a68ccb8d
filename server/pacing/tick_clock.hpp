#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "protocols/mcap/time_base.hpp"
#include "server/bench/bench.hpp"
#include "server/config/config.hpp"
#include "server/host/octave_histogram.hpp"
#include "server/pacing/pacer.hpp"

namespace drivebench {

/// Starts each tick of a run when it is due. In real time it counts how late the ticks are and gives the
/// bench the input for a late one: LateTick beyond a period, Overrun beyond max_lateness, after which the due
/// times begin anew.
class TickClock {
 public:
  TickClock(RunMode mode, const BenchConfig& config, std::unique_ptr<Pacer> pacer) noexcept
      : is_realtime_(mode == RunMode::kRealtime),
        period_ns_(config.setup.period_ns),
        max_lateness_ns_(config.realtime.max_lateness_ns),
        pacer_(std::move(pacer)) {}

  /// Returns when the next tick of the bench is due.
  void wait_for_tick() noexcept;
  /// Tells the bench how late that tick is, after the requests that had come before: one of them that clears
  /// faults knew nothing of this one, which would otherwise be gone before a sample shows it.
  void report_lateness(Bench& bench) noexcept;
  /// The time on CLOCK_MONOTONIC at which that tick was due [ns]; 0 outside real time. For the tick thread.
  std::int64_t due_ns() const noexcept { return pacer_->due_ns(); }
  /// The wall time of the bench, if its due times begin with that tick of this number; nothing outside real
  /// time. A tick ends when it is due, with the sample of the next one.
  std::optional<TimeBase> new_time_base(Tick tick) const noexcept;

  /// The next tick is due at once, and the others after it. While no tick runs.
  void begin_anew() noexcept {
    pacer_->resynchronise();
    begins_ = true;
  }

  /// The latenesses of all ticks so far; empty outside real time. For the tick thread only.
  const OctaveHistogram& lateness() const noexcept { return lateness_.own(); }
  /// The same for every thread.
  SharedOctaveHistogram::View shown_lateness() const noexcept { return lateness_.view(); }

 private:
  bool is_realtime_;
  std::int64_t period_ns_;
  std::int64_t max_lateness_ns_;
  std::unique_ptr<Pacer> pacer_;
  std::int64_t lateness_ns_ = 0;  ///< of the tick that is due
  bool begins_ = true;            ///< the due times begin with the next tick
  bool has_begun_ = false;        ///< they began with the tick that is due
  SharedOctaveHistogram lateness_;
};

}  // namespace drivebench
