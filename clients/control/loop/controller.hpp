#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string_view>

#include "clients/control/moves/trajectory.hpp"

namespace drivebench::control {

/// The measurement of tick k, for any machine. A value that the axis or the link lacks stays zero. Every
/// value must be finite: the reader of a wire on which NaN means "no value yet" replaces it.
struct Measurement {
  std::int64_t encoder_count = 0;
  double edge_age_s = 0.0;     ///< since the last edge
  double edge_period_s = 0.0;  ///< between the last two edges; 0: none yet
  std::uint64_t hall_lines = 0;
  double tachometer_v = 0.0;
  double i_a_a = 0.0;  ///< phase a; the armature of a DC machine
  double i_b_a = 0.0;
  double i_c_a = 0.0;
  double i_f_a = 0.0;  ///< field winding

  /// Of the axis that shares the amplifier of this one.
  struct Second {
    std::int64_t encoder_count = 0;
    double i_a_a = 0.0;
    double i_b_a = 0.0;
  };
  Second second{};
};

/// The quantity that the controller commands: voltages or currents.
enum class Quantity { kVoltage, kCurrent };

/// One value for each terminal for tick k, in volts or amperes; an armature is phase a. Terminals that the
/// machine does not have stay 0.
struct Setpoint {
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;
  double field = 0.0;
};

/// Sampled control of one axis: pure arithmetic, no clock, no link, no plant.
class Controller {
 public:
  virtual ~Controller() = default;

  /// One sample. `periods` says how many sample periods have passed since the previous call; more than one
  /// when samples were lost on the way. The first call defines angle 0. Does not allocate.
  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods = 1) noexcept {
    return step(m, r, periods);
  }

  Quantity quantity() const noexcept { return quantity_; }
  /// The angle since the first sample, from the encoder.
  double angle_rad() const noexcept { return seen_.angle_rad; }
  /// The speed of the controller's estimator.
  double speed_rad_s() const noexcept { return seen_.speed_rad_s; }
  /// Whether at least one terminal stood at its limit in the last sample.
  bool saturated() const noexcept { return seen_.saturated; }

  /// Further values of the last sample: names with units (like "i_q_ref_a"), and values in the same order.
  std::span<const std::string_view> telemetry_names() const noexcept {
    return std::span(telemetry_names_).first(telemetry_count_);
  }
  std::span<const double> telemetry() const noexcept { return std::span(telemetry_).first(telemetry_count_); }

 protected:
  static constexpr std::size_t kMostTelemetry = 9;

  /// The names must be literals, at most kMostTelemetry of them.
  Controller(Quantity quantity, std::span<const std::string_view> telemetry_names) noexcept;
  Controller(Quantity quantity, std::initializer_list<std::string_view> telemetry_names) noexcept
      : Controller(quantity, std::span(telemetry_names.begin(), telemetry_names.size())) {}
  Controller(const Controller&) = default;
  Controller& operator=(const Controller&) = default;

  struct Seen {
    double angle_rad = 0.0;
    double speed_rad_s = 0.0;
    bool saturated = false;
  };
  /// Stores the results of a sample at the end of every step(), with one value for each name.
  void tell(const Seen& seen, std::span<const double> telemetry) noexcept;
  void tell(const Seen& seen, std::initializer_list<double> telemetry) noexcept {
    tell(seen, std::span(telemetry.begin(), telemetry.size()));
  }

 private:
  virtual Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept = 0;

  Quantity quantity_;
  Seen seen_;
  std::size_t telemetry_count_;
  std::array<std::string_view, kMostTelemetry> telemetry_names_{};
  std::array<double, kMostTelemetry> telemetry_{};
};

}  // namespace drivebench::control
