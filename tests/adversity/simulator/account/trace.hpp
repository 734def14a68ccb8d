#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// All events of a run: their hash, the last of them, and on request every one of them on standard output.
class Trace {
 public:
  explicit Trace(bool prints) : prints_(prints) {}

  /// `what` must outlive the trace.
  void add(Time time, const char* what, std::uint64_t source = 0, std::uint64_t a = 0, std::uint64_t b = 0);
  std::uint64_t hash() const noexcept { return hash_; }
  std::uint64_t count() const noexcept { return count_; }
  /// The last ones, a line each.
  std::string tail() const;

 private:
  struct Event {
    Time time = 0;
    const char* what = "";
    std::uint64_t source = 0;
    std::uint64_t a = 0;
    std::uint64_t b = 0;
  };
  static std::string text_of(const Event& event);

  std::array<Event, 30> last_{};
  std::uint64_t count_ = 0;
  std::uint64_t hash_ = 0xCBF29CE484222325u;
  bool prints_;
};

}  // namespace drivebench::simulator
