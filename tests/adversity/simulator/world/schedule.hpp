#pragma once

#include <cstdint>
#include <functional>
#include <queue>
#include <utility>
#include <vector>

namespace drivebench::simulator {

/// Virtual time since the start of the simulation [ns].
using Time = std::int64_t;
inline constexpr Time kMicrosecond = 1'000;
inline constexpr Time kMillisecond = 1'000'000;
inline constexpr Time kSecond = 1'000'000'000;

/// Events to come, in the order of virtual time; at one time, in the order of their calls.
class Schedule {
 public:
  Time now() const noexcept { return now_; }
  void at(Time time, std::function<void()> action) {
    queue_.push({.time = time < now_ ? now_ : time, .number = ++last_, .action = std::move(action)});
  }
  void after(Time delay, std::function<void()> action) { at(now_ + delay, std::move(action)); }

  /// Of the next event; there must be one.
  Time next() const { return queue_.top().time; }
  bool empty() const noexcept { return queue_.empty(); }
  void run_next() {
    Event event = std::move(const_cast<Event&>(queue_.top()));  // it goes at once
    queue_.pop();
    now_ = event.time;
    event.action();
  }

 private:
  struct Event {
    Time time;
    std::uint64_t number;
    std::function<void()> action;
    bool operator<(const Event& other) const noexcept {
      return time != other.time ? time > other.time : number > other.number;
    }
  };
  std::priority_queue<Event> queue_;
  Time now_ = 0;
  std::uint64_t last_ = 0;
};

}  // namespace drivebench::simulator
