#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/wound_dc/series_dc_observer.hpp"
#include "clients/control/wound_dc/wound_dc_controller.hpp"

namespace drivebench::control {

/// The source of the speed of a series motor's controller.
enum class SeriesDcSpeed {
  kShaft,    ///< the estimator of the axis
  kCurrent,  ///< SeriesDcObserver, without any sensor on the shaft
};

struct SeriesDcParameters {
  WoundDcAxisParameters axis;
  double least_current_a;  ///< divisions by the current take at least this
  ServoGains speed;        ///< as of SeparateDcParameters
  SeriesDcSpeed source = SeriesDcSpeed::kShaft;
  SeriesDcObserverGains observer{};  ///< of kCurrent

  static constexpr std::tuple kGains{
      gains_in("", &SeriesDcParameters::axis),
      gain("least_current_a", &SeriesDcParameters::least_current_a, GainRule::kPositive),
      gains_in("speed.", &SeriesDcParameters::speed),
      gains_in("current_observer.", &SeriesDcParameters::observer)};
  std::vector<std::string> problems() const;
};

/// A series motor made linear: with z1 = ω and z2 = dω/dt without a load,
///   u = (R + R_f)·i + K_m·λ_f·ω + (L + dλ_f/di)·(J·v1 + f·z2)/(K_m·(λ_f + i·dλ_f/di))        so that dz2/dt
///   = v1 v1 = K0·∫(ω_ref − ω) + K1·(ω_ref − ω) + K2·(α_ref − z2) + jerk
/// Singular without current, where it takes `least_current_a`; and since the torque has one sign only, no
/// negative voltage is given to a current below that. Source: the book, problem 2.42 (CTL-10).
class SeriesDcController final : public WoundDcController {
 public:
  /// `p` must have no problems().
  explicit SeriesDcController(const SeriesDcParameters& p) noexcept;

 private:
  Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept override;
  ShaftEstimate seen_from_terminals(double armature_a, const ShaftEstimate& shaft,
                                    std::int64_t periods) noexcept override;
  void integrate(const Setpoint& excess_v) noexcept override;

  SeriesDcParameters p_;
  std::optional<SeriesDcObserver> observer_;
  double speed_error_rad_s_ = 0.0;
  double speed_integral_rad_ = 0.0;
};

struct WeakenedSeriesDcParameters {
  WoundDcAxisParameters axis;
  double most_flux_wb;              ///< λ stays below by the limit of the acceleration
  double speed_proportional_per_s;  ///< K1
  double speed_integral_per_s2;     ///< K0

  static constexpr std::tuple kGains{
      gains_in("", &WeakenedSeriesDcParameters::axis),
      gain("most_flux_wb", &WeakenedSeriesDcParameters::most_flux_wb, GainRule::kPositive),
      gain("speed.proportional_per_s", &WeakenedSeriesDcParameters::speed_proportional_per_s,
           GainRule::kPositive),
      gain("speed.integral_per_s2", &WeakenedSeriesDcParameters::speed_integral_per_s2, GainRule::kPositive)};
  std::vector<std::string> problems() const;
};

/// A series motor with a resistor R_p across its field, the armature's inductance neglected, so that
///   u = −R_p·i_f + K_m·λ_f·ω + v1·(R + R_p)·J/(K_m·λ_f)        makes dω/dt = v1 − τ_L/J
///   v1 = α_ref + K1·(ω_ref − ω) + K0·∫(ω_ref − ω)
/// The flux follows by itself, λ_f² towards v1·J·R_p·L_f/(K_m·(R_p + R_f)): v1 is kept between the values
/// that belong to `least_flux_wb` and `most_flux_wb`. Friction is a load to it. Source: the book,
/// problem 2.43 (CTL-11).
class WeakenedSeriesDcController final : public WoundDcController {
 public:
  /// `p` must have no problems().
  explicit WeakenedSeriesDcController(const WeakenedSeriesDcParameters& p) noexcept
      : WoundDcController(p.axis, FieldConnection::kSeries), p_(p) {}

 private:
  Setpoint voltages(const Reference& r, const WoundDcState& x) noexcept override;
  void integrate(const Setpoint& excess_v) noexcept override;
  double acceleration_of_flux(double flux_wb) const noexcept;

  WeakenedSeriesDcParameters p_;
  double excess_rad_s2_ = 0.0;
  double speed_error_rad_s_ = 0.0;
  double speed_integral_rad_ = 0.0;
};

}  // namespace drivebench::control
