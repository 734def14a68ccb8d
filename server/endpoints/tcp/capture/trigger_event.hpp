#pragma once

#include <cstdint>

#include "protocols/signals/catalogue.hpp"

namespace drivebench {

/// The kinds of events, in the order of v1::TriggerCondition from 1 on, which says what they mean.
enum class TriggerEventKind { kRising, kFalling, kAbove, kBelow, kLeaves, kEnters, kBitsAppear, kEquals };

/// What counts as an event of an axis.
struct TriggerEvent {
  TriggerEventKind kind;
  const Signal* signal;    ///< of the catalogue
  double level;            ///< the lower end of a band; the value that is entered
  double upper;            ///< the upper end of a band
  std::uint64_t bits = 0;  ///< of kBitsAppear, whose signal is unsigned
};

/// Looks for an event in one sample after the other. Over a gap it compares the samples on its two sides.
class EventDetector {
 public:
  explicit EventDetector(const TriggerEvent& event) noexcept : event_(event) {}

  /// Whether the event has come with this sample.
  bool see(const Sample& sample) noexcept;
  /// The next sample has no other before it.
  void forget() noexcept { has_previous_ = false; }

 private:
  bool has_bits() const noexcept { return event_.kind == TriggerEventKind::kBitsAppear; }
  bool is_inside(double value) const noexcept { return value >= event_.level && value <= event_.upper; }
  bool is_outside(double value) const noexcept { return value < event_.level || value > event_.upper; }
  bool is_event(double before, double now) const noexcept;

  TriggerEvent event_;
  bool has_previous_ = false;
  double value_ = 0.0;      // of the sample before
  std::uint64_t word_ = 0;  // the same of kBitsAppear
};

}  // namespace drivebench
