#include "clients/control/loop/controller.hpp"

#include <algorithm>
#include <cstdlib>

namespace drivebench::control {
namespace {

/// A controller whose columns do not fit is a mistake of its programmer.
void expect(bool fits) noexcept {
  if (!fits) std::abort();
}

}  // namespace

Controller::Controller(Quantity quantity, std::span<const std::string_view> telemetry_names) noexcept
    : quantity_(quantity), telemetry_count_(telemetry_names.size()) {
  expect(telemetry_count_ <= kMostTelemetry);
  std::ranges::copy(telemetry_names, telemetry_names_.begin());
}

void Controller::tell(const Seen& seen, std::span<const double> telemetry) noexcept {
  expect(telemetry.size() == telemetry_count_);
  seen_ = seen;
  std::ranges::copy(telemetry, telemetry_.begin());
}

}  // namespace drivebench::control
