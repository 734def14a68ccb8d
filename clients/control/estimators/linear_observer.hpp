#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "clients/control/math/small_matrix.hpp"

namespace drivebench::control {

/// The method that turns a differential equation into a recursion.
enum class Discretisation {
  kEuler,        ///< forward: pole −p goes to 1 − pT, stable for pT < 2
  kTrapezoidal,  ///< pole −p goes to (1 − pT/2)/(1 + pT/2), always stable
  kExact,        ///< the model over a period, inputs held, and the pole at e^(−pT)
};

/// x' = A·x + B·u + l·(y − c·x), the observer of x' = A·x + B·u, y = c·x.
template <std::size_t N, std::size_t M>
struct LinearSystem {
  Matrix<N, N> a;
  Matrix<N, M> b;
  Matrix<1, N> c;
  Matrix<N, 1> l;

  /// A − l·c, which the error follows.
  constexpr Matrix<N, N> error_matrix() const noexcept { return sum(a, product(l, c), -1.0); }
  /// Whether the error dies out.
  bool stable() const { return is_hurwitz(characteristic_polynomial(error_matrix())); }
};

/// An observer of N states from M inputs and one output, sampled. Inputs and output are those of the sample
/// instants: what is between them is held (Euler, exact) or the mean of both ends (trapezoidal).
template <std::size_t N, std::size_t M>
class LinearObserver {
 public:
  using State = std::array<double, N>;
  using Inputs = std::array<double, M>;

  LinearObserver(const LinearSystem<N, M>& system, double period_s, Discretisation how) noexcept {
    switch (how) {
      case Discretisation::kEuler:
        set_euler(system, period_s);
        break;
      case Discretisation::kTrapezoidal:
        set_trapezoidal(system, period_s);
        break;
      case Discretisation::kExact:
        set_exact(system, period_s);
        break;
    }
  }

  const State& state() const noexcept { return state_; }
  /// Starts anew from here: the next update() finds nothing to carry over.
  void reset(const State& state) noexcept {
    state_ = state;
    started_ = false;
  }

  /// From the sample before to this one, `periods` later: lost samples are put on a line between both, at
  /// most the last 64 of them. The first one has nothing before it and leaves the state.
  void update(const Inputs& u, double y, std::int64_t periods) noexcept {
    constexpr std::int64_t kLongestGap = 64;
    Drives now{};
    for (std::size_t k = 0; k < M; ++k)
      now[k] = u[k];
    now[M] = y;
    if (started_) {
      const Drives start = last_;
      for (std::int64_t left = std::min(periods, kLongestGap); left > 0; --left) {
        const double share = static_cast<double>(periods - left + 1) / static_cast<double>(periods);
        Drives next = now;
        if (left > 1) {
          for (std::size_t k = 0; k <= M; ++k)
            next[k] = start[k] + share * (now[k] - start[k]);
        }
        step(next);
      }
    }
    last_ = now;
    started_ = true;
  }

  /// Inputs that have been in force since the last sample and were not known then: call it before update().
  void correct_last(const Inputs& u) noexcept {
    for (std::size_t k = 0; k < M; ++k)
      last_[k] = u[k];
  }

  /// The matrix by which the error is multiplied from sample to sample.
  const Matrix<N, N>& transition() const noexcept { return transition_; }
  /// Whether the error dies out at this sample rate.
  bool stable() const { return is_schur(characteristic_polynomial(transition_)); }

 private:
  using Drives = std::array<double, M + 1>;  // inputs, then the output
  using DriveMatrix = Matrix<N, M + 1>;

  void step(const Drives& next) noexcept {
    State result{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t k = 0; k < N; ++k)
        result[i] += transition_[i][k] * state_[k];
      for (std::size_t k = 0; k <= M; ++k)
        result[i] += from_last_[i][k] * last_[k] + from_next_[i][k] * next[k];
    }
    state_ = result;
    last_ = next;
  }

  static DriveMatrix beside(const Matrix<N, M>& b, const Matrix<N, 1>& l) noexcept {
    DriveMatrix result{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t k = 0; k < M; ++k)
        result[i][k] = b[i][k];
      result[i][M] = l[i][0];
    }
    return result;
  }

  void set_euler(const LinearSystem<N, M>& s, double period_s) noexcept {
    transition_ = sum(scaled_identity<N>(1.0), s.error_matrix(), period_s);
    from_last_ = scaled(beside(s.b, s.l), period_s);
  }

  void set_trapezoidal(const LinearSystem<N, M>& s, double period_s) noexcept {
    const double half_s = 0.5 * period_s;
    const Matrix<N, N> error = s.error_matrix();
    const Matrix<N, N> implicit_part = sum(scaled_identity<N>(1.0), error, -half_s);
    transition_ = solved(implicit_part, sum(scaled_identity<N>(1.0), error, half_s));
    from_last_ = from_next_ = solved(implicit_part, scaled(beside(s.b, s.l), half_s));
  }

  /// Held inputs: exp([A B; 0 0]·T) holds both matrices. The injection gets the poles of exp((A − l·c)·T)
  /// by Ackermann's formula; a system that c does not show keeps T·l.
  void set_exact(const LinearSystem<N, M>& s, double period_s) noexcept {
    Matrix<N + M, N + M> joint{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t k = 0; k < N; ++k)
        joint[i][k] = period_s * s.a[i][k];
      for (std::size_t k = 0; k < M; ++k)
        joint[i][N + k] = period_s * s.b[i][k];
    }
    const Matrix<N + M, N + M> over_period = matrix_exponential(joint);
    Matrix<N, N> model{};
    Matrix<N, M> inputs{};
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t k = 0; k < N; ++k)
        model[i][k] = over_period[i][k];
      for (std::size_t k = 0; k < M; ++k)
        inputs[i][k] = over_period[i][N + k];
    }
    const Polynomial<N> poles =
        characteristic_polynomial(matrix_exponential(scaled(s.error_matrix(), period_s)));
    Matrix<N, 1> injection = injection_for(poles, model, s.c);
    if (!std::isfinite(injection[0][0])) injection = scaled(s.l, period_s);
    transition_ = sum(model, product(injection, s.c), -1.0);
    from_last_ = beside(inputs, injection);
  }

  /// φ(F)·O⁻¹·e_N with O the rows c·F^k.
  static Matrix<N, 1> injection_for(const Polynomial<N>& poles, const Matrix<N, N>& f,
                                    const Matrix<1, N>& c) noexcept {
    Matrix<N, N> observability{};
    Matrix<1, N> row = c;
    Matrix<N, N> value = scaled_identity<N>(1.0);
    for (std::size_t k = 0; k < N; ++k) {
      observability[k] = row[0];
      row = product(row, f);
      value = sum(product(value, f), scaled_identity<N>(poles[k]));
    }
    Matrix<N, 1> last{};
    last[N - 1][0] = 1.0;
    return product(value, solved(observability, last));
  }

  Matrix<N, N> transition_{};
  DriveMatrix from_last_{};
  DriveMatrix from_next_{};
  State state_{};
  Drives last_{};
  bool started_ = false;
};

}  // namespace drivebench::control
