#include "plant/train/events.hpp"

namespace drivebench {

Crossing first_crossing(const EventValues& from, const EventValues& to) noexcept {
  Crossing first;
  for (int k = 0; k < from.count; ++k) {
    const double before = from.value[static_cast<std::size_t>(k)];
    const double after = to.value[static_cast<std::size_t>(k)];
    if (!(before * after < 0.0)) continue;
    const double fraction = before / (before - after);
    if (fraction < first.fraction) first = {.event = k, .fraction = fraction};
  }
  return first;
}

void Bracket::narrow(double at, double value) noexcept {
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

}  // namespace drivebench
