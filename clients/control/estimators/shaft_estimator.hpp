#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "clients/control/estimators/edge_speed.hpp"
#include "clients/control/estimators/observers.hpp"
#include "clients/control/estimators/shaft_observers.hpp"
#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"

namespace drivebench::control {

/// The source of a controller's speed.
enum class ShaftSpeed {
  kBackwardDifference,  ///< EST-01
  kObserver,            ///< EST-02
  kLoadObserver,        ///< EST-03
  kEdges,               ///< the times of the encoder's edges
  kTachometer,
};

struct ShaftEstimatorParameters {
  double counts_per_revolution;
  ShaftSpeed source;
  ShaftObserverGains observer{};  ///< of the observers
  Discretisation discretisation = Discretisation::kEuler;
  double tachometer_vs_per_rad = 0.0;

  /// Whether the poles of the observer, if there is one, are stable and remain so at this sample rate.
  std::vector<std::string> problems(double friction_rate_per_s, double period_s) const;

  static constexpr std::tuple kWithoutTachometer{
      gain("counts_per_revolution", &ShaftEstimatorParameters::counts_per_revolution, GainRule::kPositive),
      gains_in("observer.", &ShaftEstimatorParameters::observer)};
  static constexpr auto kGains = std::tuple_cat(
      kWithoutTachometer,
      std::tuple{gain("tachometer.vs_per_rad", &ShaftEstimatorParameters::tachometer_vs_per_rad)});
};

/// The estimate of the shaft in a controller.
struct ShaftEstimate {
  double angle_rad = 0.0;    ///< measured, since the first sample
  double speed_rad_s = 0.0;  ///< by the chosen source
  double load_rad_s2 = 0.0;  ///< load over inertia; of the load observer alone
};

/// Angle, speed and load from what the bench measures, by the source of the parameters.
class ShaftEstimator {
 public:
  /// `p` must have no problems().
  ShaftEstimator(const ShaftEstimatorParameters& p, double friction_rate_per_s, double period_s) noexcept;

  /// `motor_rad_s2` is what the torque of the machine gives to its inertia at this sample.
  const ShaftEstimate& update(const Measurement& m, double motor_rad_s2, std::int64_t periods) noexcept;
  const ShaftEstimate& now() const noexcept { return now_; }

 private:
  struct Tachometer {
    double rad_per_vs;
  };
  using Source =
      std::variant<BackwardDifference, LinearObserver<2, 1>, LinearObserver<3, 1>, EdgeSpeed, Tachometer>;
  static Source source_of(const ShaftEstimatorParameters& p, double friction_rate_per_s,
                          double period_s) noexcept;

  double rad_per_count_;
  Source source_;
  bool started_ = false;
  std::int64_t start_count_ = 0;
  ShaftEstimate now_;
};

}  // namespace drivebench::control
