#pragma once

#include <cstdint>
#include <string_view>

#include "clients/control/loop/controller.hpp"
#include "clients/link/common/requests.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/signals/sample.hpp"

/// What passes between a controller and an axis.
namespace drivebench::reference {

/// The bit of a signal of the catalogue.
consteval SignalMask bit_of(std::string_view name) {
  return SignalMask{1} << (find_signal(name) - kSignals.data());
}

/// The measurement in a sample of a link with these signals; other values are zero.
control::Measurement measurement_of(const Sample& sample, SignalMask known, const Sample* second = nullptr);

/// The command with a set-point, in answer to the sample of a tick.
link::AxisCommand command_for(std::uint64_t tick, const control::Setpoint& x, control::Quantity quantity);

}  // namespace drivebench::reference
