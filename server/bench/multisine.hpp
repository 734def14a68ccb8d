#pragma once

#include <cstdint>

#include "plant/tick.hpp"
#include "server/bench/input.hpp"

namespace drivebench {

/// A multisine on its way. 8-byte members only; all zero while there is none.
struct RunningMultisine {
  std::uint64_t quantity = 0;
  std::uint64_t periods = 0;
  double amplitude = 0.0;
  std::uint64_t period_ticks = 0;
  std::uint64_t lowest = 0;
  std::uint64_t highest = 0;
  double ratio = 0.0;
  Tick start = 0;
  double base = 0.0;  ///< the value that was in force before

  bool is_running() const noexcept { return period_ticks != 0; }
  bool is_over(Tick tick) const noexcept { return tick - start >= static_cast<Tick>(periods * period_ticks); }
  bool is_on(Multisine::Quantity of) const noexcept {
    return is_running() && quantity == static_cast<std::uint64_t>(of);
  }
};

RunningMultisine begun(const Multisine& multisine, Tick start, double base) noexcept;

/// The value in force during a tick: with N lines, of which the j-th is the n_j-th multiple of 1/P,
///
///   x_k = base + A · Σ sin(2π·(n_j·k/P − φ_j)),  φ_j = line_phase(j),  k ticks after the start
///
/// n_j·k is reduced as an integer, so that each period has the same bits.
double value_at(const RunningMultisine& m, Tick tick) noexcept;

/// Whether a bench takes it: finite amplitude within its limit, and possible lines.
bool is_possible(const Multisine& multisine) noexcept;
/// Whether a state can hold it.
bool is_possible(const RunningMultisine& m) noexcept;

}  // namespace drivebench
