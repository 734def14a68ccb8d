#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "plant/injected_faults.hpp"
#include "plant/math/first_order.hpp"
#include "plant/sensors/sensors.hpp"
#include "plant/tick.hpp"
#include "plant/windings.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench {

/// The analog channels, in the order of their memory and of their noise.
enum class Channel : std::size_t {
  kCurrentA,
  kCurrentB,
  kCurrentC,
  kCurrentField,
  kVoltageA,
  kVoltageB,
  kVoltageC,
  kVoltageField,
  kBus,
  kNeutral,
  kTemperature,
  kTachometer,
  kResolverSine,
  kResolverCosine,
};
inline constexpr std::size_t kChannelCount = 14;
using AnalogValues = std::array<double, kChannelCount>;

/// The measurable quantities at one instant.
struct Measurable {
  PhaseValues current_a{};
  PhaseValues voltage_v{};
  double bus_v = 0.0;
  double neutral_v = 0.0;
  double temperature_k = 0.0;
  double angle_rad = 0.0;  ///< of the rotor, within its turn or a little beyond
  double speed_rad_s = 0.0;
};

/// The memory of the analog channels and of the power analyser. 8-byte members only.
struct SensorMemory {
  AnalogValues filtered{};              ///< behind the anti-alias filters
  AnalogValues half_tick{};             ///< in the middle of the last tick
  std::array<double, 3> shaft_end_v{};  ///< tachometer and resolver at the end of the last interval
  std::array<AnalogValues, kMaxSensorDelayTicks + 1> history{};  ///< at the last ticks, a ring by tick
  Tick tick = 0;                                                 ///< the newest in it
  MeterMemory meter{};
};

/// All analog sensors of an axis. Those of the terminals that a machine does not have read zero. A channel
/// that is off reads zero as well, but voltages and bus then are the true ones.
class SensorBank {
 public:
  /// The parameters must be free of problems(). Noise channel n of the axis is noise_channel + n. `step_s` is
  /// the usual length of an interval: the filters are prepared for it, other lengths cost more.
  SensorBank(const SensorParameters& p, Connection connection, double period_s, std::uint64_t seed,
             std::uint64_t noise_channel, double step_s = 0.0, bool has_field = true) noexcept;
  void set_parameters(const SensorParameters& p) noexcept;

  /// As if `now` had been there forever before `tick`.
  SensorMemory settled(const Measurable& now, Tick tick) const noexcept;

  /// Whether a channel has a filter or half a tick of delay, or the meter runs: follow() is needed then.
  bool follows() const noexcept { return p_.meter.enabled || has_filters_ || half_count_ > 0; }
  /// The interval from start_s within the tick; between its ends every quantity goes linearly.
  void follow(SensorMemory& m, double start_s, double duration_s, const Measurable& from,
              const Measurable& to) const noexcept;
  /// The tick has ended, `tick` begins.
  void end_tick(SensorMemory& m, const Measurable& now, Tick tick) const noexcept;
  /// The sample of `tick` with what these sensors say at its start, and the bits of the fault word for
  /// converters at their end: a pure function of its arguments.
  Sample readings(const SensorMemory& m, const InjectedFaults& faults, Tick tick) const noexcept;

 private:
  /// Channels of one section have the same filter.
  enum class Section : std::size_t {
    kCurrent,
    kVoltage,
    kBus,
    kNeutral,
    kTemperature,
    kTachometer,
    kResolver
  };
  static constexpr std::size_t kSectionCount = 7;
  struct Filter {
    double rate_per_s = 0.0;  ///< one over the time constant; 0: no filter
    FirstOrderStep usual{};   ///< for an interval of step_s_
  };
  class FilterSteps;

  AnalogParameters& channel(Channel c) noexcept { return channels_[static_cast<std::size_t>(c)]; }
  void set_channels() noexcept;
  void set_filter(Section section, const AnalogParameters& p) noexcept;
  AnalogValues inputs(const Measurable& x) const noexcept;
  void filter(SensorMemory& m, double start_s, double duration_s, const Measurable& from,
              const Measurable& to) const noexcept;
  void filter_shaft(SensorMemory& m, double start_s, FilterSteps& steps, const Measurable& from,
                    const Measurable& to) const noexcept;
  void keep_middle(SensorMemory& m, const Measurable& middle) const noexcept;
  struct Errors {
    double gain;
    double offset;
    double noise_rms;
  };
  /// What the converter of a channel sees.
  double analog(const SensorMemory& m, Channel c, const Errors& errors, Tick tick) const noexcept;
  AnalogReading read(const SensorMemory& m, Channel c, const Errors& errors, Tick tick) const noexcept;

  SensorParameters p_;
  Connection connection_;
  double period_s_;
  std::uint64_t seed_;
  std::uint64_t noise_channel_;
  double step_s_;
  bool has_field_;
  bool has_filters_ = false;
  double meter_ticks_ = 1.0;
  std::array<AnalogParameters, kChannelCount> channels_{};
  std::array<Filter, kSectionCount> filters_{};
  std::array<std::size_t, kChannelCount> half_{};  ///< channels with half a tick of delay
  std::size_t half_count_ = 0;
};

}  // namespace drivebench
