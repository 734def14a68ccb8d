#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "protocols/signals/command.hpp"

namespace drivebench {

/// Time at gate level since tick 0 [ps]: 63 bits are 106 days.
using Picoseconds = std::int64_t;

/// The last instant at gate level.
inline constexpr Picoseconds kLastPicosecond = 9'000'000'000'000'000'000;

/// What a leg does; the numbers are those of drivebench_leg_mode.
enum class LegMode : std::uint32_t {
  kOpen = 0,     ///< both switches open
  kLow = 1,      ///< lower switch closed
  kHigh = 2,     ///< upper switch closed
  kPwm = 3,      ///< PWM, complementary: upper switch on for compare of period, lower switch else
  kPwmHigh = 4,  ///< PWM of the upper switch alone
  kPwmLow = 5,   ///< PWM of the lower switch alone
};

/// The settings of a leg's timer. The grid of periods reaches in both directions from period_start.
struct LegSetting {
  static constexpr Picoseconds kShortestPeriod = 100'000;
  static constexpr Picoseconds kLongestPeriod = 1'000'000'000'000;
  static constexpr Picoseconds kLongestDead = 1'000'000'000;

  LegMode mode = LegMode::kOpen;
  std::uint32_t centred = 0;  ///< 1: on in the middle of the period; 0: from its start on
  Picoseconds period_start = 0;
  Picoseconds period = 0;   ///< of the PWM modes, above 0
  Picoseconds compare = 0;  ///< on for so long, 0 to period
  Picoseconds dead = 0;     ///< a switch closes so long after the other one of its leg has opened

  bool operator==(const LegSetting&) const noexcept = default;
};

/// Whether a timer can have this setting: its numbers are within their limits.
bool is_possible(const LegSetting& setting) noexcept;

/// A leg played by its timer: 8-byte members only.
class LegTimer {
 public:
  static constexpr Picoseconds kNever = INT64_MAX;

  /// From `now` on.
  void set(const LegSetting& setting, Picoseconds now) noexcept {
    setting_ = setting;
    change_to(now);
  }
  const LegSetting& setting() const noexcept { return setting_; }

  /// Goes on to `now`, which is not beyond next().
  void go_to(Picoseconds now) noexcept {
    if (now >= next_) change_to(now);
  }
  /// What the leg is at from the last go_to() to next().
  LegLevel level() const noexcept { return level_; }
  /// The instant of the next change; kNever if there is none.
  Picoseconds next() const noexcept { return next_; }
  /// Whether a timer can have come to this at `now`: for one from bytes.
  bool is_possible(Picoseconds now) const noexcept;

 private:
  static constexpr Picoseconds kLongAgo = -(Picoseconds{1} << 62);

  void change_to(Picoseconds now) noexcept;
  LegLevel wanted(Picoseconds now) const noexcept;
  Picoseconds next_after(Picoseconds now) const noexcept;
  bool switches() const noexcept {
    return setting_.mode >= LegMode::kPwm && setting_.compare > 0 && setting_.compare < setting_.period;
  }
  /// From the start of the period.
  Picoseconds on_from() const noexcept {
    return setting_.centred != 0 ? (setting_.period - setting_.compare) / 2 : 0;
  }
  /// Since the start of the period that is running.
  Picoseconds phase(Picoseconds now) const noexcept;

  LegSetting setting_{};
  LegLevel wanted_ = LegLevel::kOff;
  LegLevel level_ = LegLevel::kOff;
  Picoseconds closes_ = 0;                                 ///< what is wanted
  std::array<Picoseconds, 2> opened_{kLongAgo, kLongAgo};  ///< lower and upper switch, last
  Picoseconds next_ = kNever;
};

}  // namespace drivebench
