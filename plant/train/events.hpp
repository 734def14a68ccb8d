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
Crossing located_event(const EventValues& before, EventValues after, ValuesAfter values_after) noexcept {
  constexpr int kMaxGuesses = 10;
  constexpr int kMaxEarlier = 3;
  constexpr double kTogether = 1.0 - 1e-9;  // the last two currents of a star die at once
  Crossing crossing = first_crossing(before, after);
  double end = 1.0;
  for (int earlier = 0; crossing.event >= 0; ++earlier) {
    const auto which = static_cast<std::size_t>(crossing.event);
    Bracket bracket{.low_value = before.value[which], .high = end, .high_value = after.value[which]};
    const double close_enough = 1e-13 * (std::abs(bracket.low_value) + std::abs(bracket.high_value));
    for (int guess = 0; guess < kMaxGuesses; ++guess) {
      crossing.fraction = bracket.guess();
      after = values_after(crossing.fraction);
      if (std::abs(after.value[which]) <= close_enough) break;
      bracket.narrow(crossing.fraction, after.value[which]);
    }
    // Another one may have come before: its value goes less linearly.
    after.value[which] = 0.0;
    const Crossing first = first_crossing(before, after);
    if (first.fraction >= kTogether || earlier == kMaxEarlier) break;
    end = crossing.fraction;
    crossing.event = first.event;
  }
  return crossing;
}

}  // namespace drivebench
