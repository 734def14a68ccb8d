#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace drivebench {

/// What happens at an instant within a tick; the numbers are those of drivebench_event_kind.
enum class EventKind : std::uint32_t {
  kComparator = 1,   ///< of a terminal: its level is another one
  kHall = 2,         ///< a Hall line has another level
  kCurrentZero = 3,  ///< the current of a terminal has died in its diode
  kBreak = 4,        ///< the break input has opened all legs
};

struct PlantEvent {
  double at_s;  ///< from the start of the tick
  EventKind kind;
  std::uint32_t channel;  ///< 0 for terminal a or line 1
  std::uint32_t level;    ///< 0 or 1, after it
};

/// The events of a piece of a tick. Full, it counts those that it leaves out.
class EventLog {
 public:
  void clear() noexcept { count_ = 0; }
  void add(const PlantEvent& event) noexcept {
    if (count_ < events_.size()) {
      events_[count_++] = event;
    } else {
      ++lost_;
    }
  }
  std::size_t size() const noexcept { return count_; }
  const PlantEvent& operator[](std::size_t n) const noexcept { return events_[n]; }
  std::uint64_t lost() const noexcept { return lost_; }

 private:
  std::array<PlantEvent, 512> events_;
  std::size_t count_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace drivebench
