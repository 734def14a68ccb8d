#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "plant/sensors/analog_channel.hpp"
#include "plant/sensors/angle_path.hpp"
#include "plant/tick.hpp"

namespace drivebench {

/// Section [axis.absolute_encoder]: a chip that gives the angle within a turn as a number, which a firmware
/// reads over SPI.
struct AbsoluteEncoderParameters {
  int bits = 0;             ///< 2^bits steps in a turn; 0: there is none
  double latency_s = 0.0;   ///< age of the angle at the sample, at most kMaxSensorDelayTicks ticks
  double offset_rad = 0.0;  ///< added to the angle: how the magnet is mounted
};

inline constexpr int kMaxAbsoluteBits = 24;

/// The numbers that are on their way. 8-byte members only.
struct AbsoluteMemory {
  std::uint64_t latched = 0;                                      ///< in the tick that is running
  std::array<std::uint64_t, kMaxSensorDelayTicks + 1> history{};  ///< in those before, by tick
};

/// Latches the angle of the instant that lies latency_s before a sample. A latency of m ticks and a part f of
/// one is the instant T - f of the tick that ends m ticks before the sample.
class AbsoluteEncoder {
 public:
  AbsoluteEncoder(const AbsoluteEncoderParameters& p, double period_s) noexcept;

  bool enabled() const noexcept { return p_.bits > 0; }
  /// As if the shaft had been at this angle for ever.
  AbsoluteMemory settled(double angle_rad) const noexcept;
  /// The shaft through a tick or a part of it, given as consecutive segments.
  void follow(AbsoluteMemory& m, std::span<const AngleSegment> segments) const noexcept;
  /// The tick has ended, `tick` begins.
  void end_tick(AbsoluteMemory& m, Tick tick) const noexcept { m.history[slot_of(tick)] = m.latched; }
  /// What it gives at the start of `tick`, the newest.
  std::uint64_t read(const AbsoluteMemory& m, Tick tick) const noexcept {
    return m.history[slot_of(tick - late_ticks_)];
  }

 private:
  static constexpr std::size_t slot_of(Tick tick) noexcept {
    constexpr Tick kSlots = kMaxSensorDelayTicks + 1;
    return static_cast<std::size_t>((tick + kSlots) % kSlots);
  }
  std::uint64_t number_at(double angle_rad) const noexcept;

  AbsoluteEncoderParameters p_;
  Tick late_ticks_;   ///< whole ticks of the latency
  double instant_s_;  ///< from the start of the tick, above 0
};

}  // namespace drivebench
