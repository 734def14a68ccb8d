#include "clients/control/estimators/shaft_observers.hpp"

namespace drivebench::control {

LinearSystem<2, 1> shaft_observer(const ShaftObserverGains& gains, double friction_rate_per_s) noexcept {
  return {.a = {{{0.0, 1.0}, {0.0, -friction_rate_per_s}}},
          .b = {{{0.0}, {1.0}}},
          .c = {{{1.0, 0.0}}},
          .l = {{{gains.angle_per_s}, {gains.speed_per_s2}}}};
}

LinearSystem<3, 1> load_observer(const ShaftObserverGains& gains, double friction_rate_per_s) noexcept {
  return {.a = {{{0.0, 1.0, 0.0}, {0.0, -friction_rate_per_s, -1.0}, {0.0, 0.0, 0.0}}},
          .b = {{{0.0}, {1.0}, {0.0}}},
          .c = {{{1.0, 0.0, 0.0}}},
          .l = {{{gains.angle_per_s}, {gains.speed_per_s2}, {gains.load_per_s3}}}};
}

}  // namespace drivebench::control
