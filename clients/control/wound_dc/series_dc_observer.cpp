#include "clients/control/wound_dc/series_dc_observer.hpp"

#include <cmath>

#include "plant/math/trig.hpp"

namespace drivebench::control {

LinearSystem<3, 2> series_dc_observer(const WoundDcModel& model,
                                      const SeriesDcObserverGains& gains) noexcept {
  // Without l3 the load is a state that nothing drives and that drives nothing: it decays by itself.
  const bool with_load = gains.load_per_s3 != 0.0;
  const double coupling = with_load ? -1.0 : 0.0;
  const double decay = with_load ? 0.0 : -1.0;
  return {.a = {{{0.0, -model.motor_constant, 0.0},
                 {0.0, -model.friction_rate_per_s(), coupling},
                 {0.0, 0.0, decay}}},
          .b = {{{1.0, 0.0}, {0.0, 1.0}, {0.0, 0.0}}},
          .c = {{{1.0, 0.0, 0.0}}},
          .l = {{{gains.flux_per_s}, {gains.speed_per_s2}, {gains.load_per_s3}}}};
}

SeriesDcObserver::SeriesDcObserver(const WoundDcModel& model, const SeriesDcObserverGains& gains,
                                   double least_current_a, double period_s, Discretisation how) noexcept
    : model_(model),
      least_current_a_(least_current_a),
      log_share_(1.0 + model.armature_inductance_h / model.flux_slope_h(0.0)),
      observer_(series_dc_observer(model, gains), period_s, how) {}

std::array<double, 2> SeriesDcObserver::inputs(double current_a, double voltage_v) const noexcept {
  const double flux_wb = std::abs(model_.flux_wb(current_a));
  // A negative voltage that drives a negative current does what a positive one does.
  const double drive_v = std::copysign(1.0, current_a) * voltage_v -
                         (model_.armature_resistance_ohm + model_.field_resistance_ohm) * std::abs(current_a);
  return {drive_v / flux_wb, model_.torque_nm(flux_wb, std::abs(current_a)) / model_.inertia_kgm2};
}

void SeriesDcObserver::update(double current_a, double voltage_v, std::int64_t periods) noexcept {
  if (!(std::abs(current_a) >= least_current_a_)) {
    running_ = false;
    return;
  }
  const double output = log_share_ * logarithm(std::abs(model_.flux_wb(current_a)));
  if (running_) {
    observer_.correct_last(inputs(last_current_a_, voltage_v));
  } else {
    running_ = true;
    observer_.reset({output, speed_rad_s_, load_rad_s2_});
  }
  observer_.update(inputs(current_a, voltage_v), output, periods);
  last_current_a_ = current_a;
  speed_rad_s_ = observer_.state()[1];
  load_rad_s2_ = observer_.state()[2];
}

}  // namespace drivebench::control
