#pragma once

#include <array>
#include <cstdint>

#include "protocols/timing/answer_times.hpp"
#include "server/bench/bench.hpp"
#include "server/host/clock.hpp"

namespace drivebench {

/// Measures when the commands for an axis come, on the I/O thread: what leaves and comes there has been
/// through the operating system, and a tick asks for no time.
class AnswerClock {
 public:
  /// A sample is about to go to its readers.
  void sample_leaves(Tick tick) noexcept { departures_[place_of(tick)] = {.tick = tick, .at_ns = now_ns()}; }

  /// A command has been taken. Only the first that answers a sample counts, and the first of a lease does
  /// not: its controller had not waited for a sample. `period`: that of the sample in real time.
  struct Period {
    std::int64_t begin_ns = 0;
    std::int64_t length_ns = 0;  ///< 0: not in real time
  };
  void command_comes(Owner owner, const Command& command, Period period) noexcept {
    const std::int64_t now = now_ns();
    const bool is_first_of_lease = owner != owner_;
    owner_ = owner;
    if (is_first_of_lease || command.answers == answered_) {
      answered_ = command.answers;
      return;
    }
    answered_ = command.answers;
    const Departure& left = departures_[place_of(answered_)];
    const bool is_known = left.tick == answered_;
    if (is_known) times_.after_sample.add(now - left.at_ns);
    if (period.length_ns == 0) return;
    // A sample of so long ago left when its tick was due, or little later.
    if (!is_known) times_.after_sample.add(now - period.begin_ns);
    times_.after_tick.add(now - period.begin_ns);
    if (now - period.begin_ns >= period.length_ns) ++times_.late;
  }

  const AnswerTimes& times() const noexcept { return times_; }

 private:
  struct Departure {
    Tick tick = -1;
    std::int64_t at_ns = 0;
  };
  static constexpr std::size_t kRemembered = 256;

  static std::int64_t now_ns() noexcept { return ServerClock::now().time_since_epoch().count(); }
  static std::size_t place_of(Tick tick) noexcept { return static_cast<std::size_t>(tick) % kRemembered; }

  std::array<Departure, kRemembered> departures_{};
  Owner owner_ = 0;
  Tick answered_ = -1;
  AnswerTimes times_;
};

}  // namespace drivebench
