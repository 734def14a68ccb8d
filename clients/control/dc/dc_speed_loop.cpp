#include "clients/control/dc/dc_speed_loop.hpp"

namespace drivebench::control {

std::span<const GainRow<DcSpeedLoopParameters>> DcSpeedLoopParameters::gains() noexcept {
  using P = DcSpeedLoopParameters;
  static constexpr auto kRows = joined(
      kDcAxisRows<P>, std::to_array<GainRow<P>>({
                          {"speed.proportional_as_per_rad",
                           [](P& p) -> double& { return p.proportional_as_per_rad; }, GainRule::kNotNegative},
                      }));
  return kRows;
}

}  // namespace drivebench::control
