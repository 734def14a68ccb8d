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

}  // namespace drivebench
