#pragma once

namespace drivebench {

/// One step of the search for a zero between two points by the Illinois method. The values at both ends have
/// different signs.
struct Bracket {
  double low = 0.0;
  double low_value;
  double high = 1.0;
  double high_value;
  int side = 0;

  double guess() const noexcept { return low + (high - low) * (low_value / (low_value - high_value)); }

  void narrow(double at, double value) noexcept {
    if (low_value * value < 0.0) {
      high = at;
      high_value = value;
      if (side == -1) low_value *= 0.5;
      side = -1;
    } else {
      low = at;
      low_value = value;
      if (side == 1) high_value *= 0.5;
      side = 1;
    }
  }
};

}  // namespace drivebench
