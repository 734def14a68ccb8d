#include "clients/control/dc/dc_open_loop.hpp"

namespace drivebench::control {

std::span<const GainRow<DcOpenLoopParameters>> DcOpenLoopParameters::gains() noexcept {
  return kDcAxisRows<DcOpenLoopParameters>;
}

}  // namespace drivebench::control
