#pragma once

#include <cstddef>
#include <type_traits>

namespace drivebench {
namespace rk4_detail {

struct AnyMember {
  template <class T>
  constexpr operator T()
      const noexcept;  // NOLINT(google-explicit-constructor): stands for a member of any type
};

/// Number of members of a plain struct, from the longest list that initialises it.
template <class State, class... Members>
constexpr std::size_t member_count() {
  if constexpr (requires { State{Members{}..., AnyMember{}}; }) {
    return member_count<State, Members..., AnyMember>();
  } else {
    return sizeof...(Members);
  }
}

/// f(member of x, member of y) for every double in the (possibly nested) state. Structured bindings keep each
/// member a value of its own, which g++ holds in registers; through arrays and bit_cast the same sums take
/// three times as long.
template <class F>
constexpr double zip(const F& f, double x, double y) noexcept {
  return f(x, y);
}

template <class F, class State>
constexpr State zip(const F& f, const State& x, const State& y) noexcept {
  constexpr std::size_t kMembers = member_count<State>();
  static_assert(kMembers >= 1 && kMembers <= 4, "a state has one to four members; nest structs for more");
  if constexpr (kMembers == 1) {
    const auto& [x1] = x;
    const auto& [y1] = y;
    return {zip(f, x1, y1)};
  } else if constexpr (kMembers == 2) {
    const auto& [x1, x2] = x;
    const auto& [y1, y2] = y;
    return {zip(f, x1, y1), zip(f, x2, y2)};
  } else if constexpr (kMembers == 3) {
    const auto& [x1, x2, x3] = x;
    const auto& [y1, y2, y3] = y;
    return {zip(f, x1, y1), zip(f, x2, y2), zip(f, x3, y3)};
  } else if constexpr (kMembers == 4) {
    const auto& [x1, x2, x3, x4] = x;
    const auto& [y1, y2, y3, y4] = y;
    return {zip(f, x1, y1), zip(f, x2, y2), zip(f, x3, y3), zip(f, x4, y4)};
  }
}

}  // namespace rk4_detail

/// x + factor * slope, member by member.
template <class State>
constexpr State advanced(const State& x, double factor, const State& slope) noexcept {
  return rk4_detail::zip([factor](double a, double k) { return a + factor * k; }, x, slope);
}

/// The place of a Runge-Kutta stage in its step, for inputs that change within it.
enum class StepPoint { kStart, kMiddle, kEnd };

template <class F, class State>
concept TimedDerivative = std::is_invocable_v<const F&, const State&, StepPoint>;
template <class F, class State>
concept SteadyDerivative = std::is_invocable_v<const F&, const State&>;

/// One classical fourth-order Runge-Kutta step of x' = derivative(x, point) over step_s. A state is a plain
/// struct of doubles or of such structs.
template <class State, TimedDerivative<State> Derivative>
constexpr State rk4_step(const State& x, double step_s, const Derivative& derivative) noexcept {
  const State k1 = derivative(x, StepPoint::kStart);
  const State k2 = derivative(advanced(x, 0.5 * step_s, k1), StepPoint::kMiddle);
  const State k3 = derivative(advanced(x, 0.5 * step_s, k2), StepPoint::kMiddle);
  const State k4 = derivative(advanced(x, step_s, k3), StepPoint::kEnd);
  const State outer = advanced(k1, 1.0, k4);
  const State inner = advanced(k2, 1.0, k3);
  return advanced(x, step_s / 6.0, advanced(outer, 2.0, inner));
}

/// The same for x' = derivative(x).
template <class State, SteadyDerivative<State> Derivative>
constexpr State rk4_step(const State& x, double step_s, const Derivative& derivative) noexcept {
  return rk4_step(x, step_s,
                  [&derivative](const State& s, StepPoint) noexcept -> State { return derivative(s); });
}

}  // namespace drivebench
