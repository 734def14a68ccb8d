#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "plant/math/bracket.hpp"

namespace drivebench {

/// Numbers whose passing through zero ends a piece of a tick: at most four of the shaft, and of each machine
/// on it three of the terminals, a corner and three currents at the limit of the break input.
struct EventValues {
  std::array<double, 18> value;  ///< the first `count` of them
  int shaft = 0;                 ///< number of them that belong to the shaft; the rest follows
  int count = 0;

  void add(double v) noexcept { value[static_cast<std::size_t>(count++)] = v; }
};

/// The first of the values that passes zero, going linearly, and the part of the piece after which it does.
struct Crossing {
  int event = -1;
  double fraction = 1.0;
};
Crossing first_crossing(const EventValues& from, const EventValues& to) noexcept;

/// The event that comes first in a piece of which the values at both ends are known, and the part of the
/// piece after which it comes. `values_after(fraction)` takes the step anew over this part of the piece; the
/// last call is the one with the result.
template <class ValuesAfter>
Crossing located_event(const EventValues& before, const EventValues& after,
                       ValuesAfter values_after) noexcept {
  constexpr int kMaxGuesses = 6;
  Crossing crossing = first_crossing(before, after);
  if (crossing.event < 0) return crossing;
  const auto which = static_cast<std::size_t>(crossing.event);
  Bracket bracket{.low_value = before.value[which], .high_value = after.value[which]};
  const double close_enough = 1e-13 * (std::abs(bracket.low_value) + std::abs(bracket.high_value));
  for (int guess = 0; guess < kMaxGuesses; ++guess) {
    crossing.fraction = bracket.guess();
    const double value = values_after(crossing.fraction).value[which];
    if (std::abs(value) <= close_enough) break;
    bracket.narrow(crossing.fraction, value);
  }
  return crossing;
}

}  // namespace drivebench
