#include "plant/sensors/comparators.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "plant/math/bracket.hpp"
#include "plant/math/exponential.hpp"
#include "plant/math/rounding.hpp"
#include "plant/math/trig.hpp"

namespace drivebench {
namespace {

constexpr double kNoiseStepS = 1e-6;
constexpr double kMostNoise = 8.58;  // NoiseChannel::gaussian() is never beyond

constexpr std::size_t index_of(int k) noexcept {
  return static_cast<std::size_t>(k);
}

constexpr double of(const ThreePhase& x, int k) noexcept {
  return k == 0 ? x.a : (k == 1 ? x.b : x.c);
}

constexpr double mean(const ThreePhase& x) noexcept {
  return (x.a + x.b + x.c) / 3.0;
}

/// A zero is found to this part of the values at both ends.
constexpr double kCloseEnough = 1e-14;

/// The instant between two at which f is zero.
template <class F>
double zero_between(const F& f, double from, double from_value, double to, double to_value) noexcept {
  constexpr int kMaxGuesses = 60;
  Bracket bracket{.low = from, .low_value = from_value, .high = to, .high_value = to_value};
  const double close_enough = kCloseEnough * (std::abs(from_value) + std::abs(to_value));
  double at = from;
  for (int guess = 0; guess < kMaxGuesses; ++guess) {
    at = bracket.guess();
    const double value = f(at);
    if (std::abs(value) <= close_enough) break;
    bracket.narrow(at, value);
  }
  return at;
}

/// Terminal less reference at three instants of an interval.
struct Difference {
  double start_v;
  double middle_v;
  double end_v;

  /// The control point of the parabola: it lies between its ends and this one.
  double control_v() const noexcept { return 2.0 * middle_v - 0.5 * (start_v + end_v); }
};

}  // namespace

/// What a comparator sees at t, the part of an interval that has passed: 0 to 1. With u = u0 + u1 t + u2 t²
/// before the RC, whose time constant is T in this unit,
///   T y' = u - y     y = (u0 - u1 T + 2 u2 T²) + (u1 - 2 u2 T) t + u2 t² + C e^(-t/T)
class Comparators::Input {
 public:
  explicit Input(const Difference& u) noexcept
      : constant_v_(u.start_v),
        slope_(4.0 * u.middle_v - 3.0 * u.start_v - u.end_v),
        curve_(2.0 * (u.start_v - 2.0 * u.middle_v + u.end_v)) {}

  /// `rate` is 1/T. In an interval so short that u2 T² is the rounding of u, its mean acts.
  void filter(double time_constant, double rate, double filtered_v) noexcept {
    constexpr double kShort = 1e-6;
    if (rate < kShort) {
      constant_v_ += 0.5 * slope_ + curve_ / 3.0;
      slope_ = curve_ = 0.0;
    } else {
      constant_v_ += time_constant * (2.0 * curve_ * time_constant - slope_);
      slope_ -= 2.0 * curve_ * time_constant;
    }
    transient_v_ = filtered_v - constant_v_;
    time_constant_ = time_constant;
    rate_ = rate;
  }

  double at(double t) const noexcept { return along(t) + (filters() ? transient_v_ * decay(t) : 0.0); }
  /// The same where e^(-t/T) is known.
  double at(double t, double decay) const noexcept { return along(t) + transient_v_ * decay; }

  /// The instants between which it rises or falls all the time: `from`, those where it turns, `to`.
  struct Runs {
    std::array<double, 4> instant;
    std::size_t count = 0;
    void add(double t) noexcept { instant[count++] = t; }
  };
  Runs runs(double from, double to) const noexcept {
    Runs result;
    result.add(from);
    if (keeps_direction(from, to)) {
      result.add(to);
      return result;
    }
    const double bends_at = bend();
    if (bends_at > from && bends_at < to) {
      add_turn(from, bends_at, result);
      add_turn(bends_at, to, result);
    } else {
      add_turn(from, to, result);
    }
    result.add(to);
    return result;
  }

  /// The instant within one of these at which it passes a voltage; from_v and to_v are what it is beyond that
  /// at the ends.
  double passes(double level_v, double from, double from_v, double to, double to_v) const noexcept {
    const double close_enough_v = kCloseEnough * (std::abs(from_v) + std::abs(to_v));
    if (const std::optional<double> at_once = settles_at(level_v, from, to, close_enough_v)) return *at_once;
    return zero_between([&](double t) noexcept { return at(t) - level_v; }, from, from_v, to, to_v);
  }

 private:
  bool filters() const noexcept { return rate_ > 0.0; }
  /// Whether parabola and transient go the same way, so that it turns nowhere: no exponential is needed.
  bool keeps_direction(double from, double to) const noexcept {
    const double first = slope_ + 2.0 * curve_ * from;
    const double last = slope_ + 2.0 * curve_ * to;
    const double settling = filters() ? -transient_v_ : 0.0;
    return (first >= 0.0 && last >= 0.0 && settling >= 0.0) ||
           (first <= 0.0 && last <= 0.0 && settling <= 0.0);
  }
  double along(double t) const noexcept { return constant_v_ + t * (slope_ + t * curve_); }
  /// Asked for an instant several times, the last two are kept.
  double decay(double t) const noexcept {
    if (t == 0.0) return 1.0;
    if (t == newest_.at) return newest_.decay;
    if (t == older_.at) return older_.decay;
    older_ = newest_;
    newest_ = {.at = t, .decay = exponential(-rate_ * t)};
    return newest_.decay;
  }
  double slope(double t) const noexcept {
    return slope_ + 2.0 * curve_ * t - (filters() ? rate_ * transient_v_ * decay(t) : 0.0);
  }
  /// Where the slope itself turns; before the interval if it does not.
  double bend() const noexcept {
    const double bending = rate_ * rate_ * transient_v_;
    if (bending == 0.0) return -1.0;
    const double ratio = -2.0 * curve_ / bending;
    return ratio > 0.0 && std::isfinite(ratio) ? -logarithm(ratio) * time_constant_ : -1.0;
  }
  /// Between two instants the slope rises or falls all the time: it is zero at most once.
  void add_turn(double from, double to, Runs& runs) const noexcept {
    const double first = slope(from);
    const double last = slope(to);
    if (!(first * last < 0.0)) return;
    const auto slope_at = [this](double t) noexcept { return slope(t); };
    runs.add(zero_between(slope_at, from, first, to, last));
  }
  /// passes() by Newton's method, a logarithm and no exponential, from the instant at which the transient
  /// would reach the level if the parabola stayed where it is at `from`. Nothing without a transient, and
  /// where this does not settle at once.
  std::optional<double> settles_at(double level_v, double from, double to,
                                   double close_enough_v) const noexcept {
    constexpr int kMaxGuesses = 4;
    constexpr double kShort = 1.0 / 64.0;  // step_decay() errs by 1e-16 there
    if (transient_v_ == 0.0) return std::nullopt;
    double decay = (level_v - along(from)) / transient_v_;
    if (!(decay > 0.0 && decay <= 1.0)) return std::nullopt;
    double at = -logarithm(decay) * time_constant_;
    for (int guess = 0; guess < kMaxGuesses; ++guess) {
      if (!(at > from && at < to)) return std::nullopt;
      const double rest_v = transient_v_ * decay;
      const double v = along(at) + rest_v - level_v;
      if (std::abs(v) <= close_enough_v) return at;
      const double falling_v = rate_ * rest_v - slope_ - 2.0 * curve_ * at;
      if (!(std::abs(rate_ * v) <= kShort * std::abs(falling_v)) || falling_v == 0.0) return std::nullopt;
      const double step = v / falling_v;
      at += step;
      decay *= step_decay(rate_ * step);
    }
    return std::nullopt;
  }
  /// e^-x by its first terms.
  static double step_decay(double x) noexcept {
    return 1.0 - x * (1.0 - x * (1.0 / 2.0 -
                                 x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0))))));
  }

  double constant_v_;
  double slope_;
  double curve_;
  double transient_v_ = 0.0;
  double time_constant_ = 0.0;
  double rate_ = 0.0;
  struct Decay {
    double at = 0.0;
    double decay = 1.0;
  };
  mutable Decay newest_{};
  mutable Decay older_{};
};

Comparators::Comparators(const ComparatorParameters& p, double period_s, std::uint64_t seed,
                         std::uint64_t noise_channel) noexcept
    : p_(p),
      period_s_(period_s),
      noise_steps_(std::max<std::int64_t>(1, floor_to_integer(period_s / kNoiseStepS + 0.5))),
      noise_step_s_(period_s / static_cast<double>(noise_steps_)),
      noise_{NoiseChannel(seed, noise_channel), NoiseChannel(seed, noise_channel + 1),
             NoiseChannel(seed, noise_channel + 2)} {}

double Comparators::offset_v(int terminal) const noexcept {
  return terminal == 0 ? p_.offset_a_v : (terminal == 1 ? p_.offset_b_v : p_.offset_c_v);
}

ComparatorMemory Comparators::settled(double link_v) const noexcept {
  ComparatorMemory m;
  if (!p_.enabled) return m;
  const double v = p_.reference == ComparatorReference::kFixed ? 0.5 * link_v - p_.reference_v : 0.0;
  m.filtered_v = {.a = v, .b = v, .c = v};
  for (int k = 0; k < 3; ++k) {
    if (v + offset_v(k) > 0.5 * p_.hysteresis_v) m.levels |= std::uint64_t{1} << k;
  }
  return m;
}

void Comparators::follow(ComparatorMemory& m, Tick tick, double start_s, double duration_s,
                         const TerminalPath& path, EventLog* log) const noexcept {
  const auto reference_v = [&](const ThreePhase& v) noexcept {
    if (p_.reference == ComparatorReference::kVirtualNeutral) return mean(v);
    return p_.reference == ComparatorReference::kHalfLink ? 0.5 * path.link_v : p_.reference_v;
  };
  const ThreePhase reference{
      .a = reference_v(path.start_v), .b = reference_v(path.middle_v), .c = reference_v(path.end_v)};
  const bool filters = p_.rc_s > 0.0;
  const double rate = filters ? duration_s / p_.rc_s : 0.0;
  const double time_constant = filters ? p_.rc_s / duration_s : 0.0;
  const double decay = filters ? exponential(-rate) : 1.0;
  std::array<double, 3> filtered_v{m.filtered_v.a, m.filtered_v.b, m.filtered_v.c};
  for (int k = 0; k < 3; ++k) {
    const Difference u{.start_v = of(path.start_v, k) - reference.a,
                       .middle_v = of(path.middle_v, k) - reference.b,
                       .end_v = of(path.end_v, k) - reference.c};
    Input input(u);
    double& y = filtered_v[index_of(k)];
    const double before_v = filters ? y : u.start_v;
    if (filters) input.filter(time_constant, rate, y);
    const auto [lowest_v, highest_v] = std::minmax({u.start_v, u.control_v(), u.end_v});
    const Span given{.lowest_v = lowest_v, .highest_v = highest_v};
    if (!is_out_of_reach(away_v(m, k, given.with(before_v)))) {
      switch_within(m, {k, tick, start_s, duration_s, log}, input, given);
    }
    y = filters ? input.at(1.0, decay) : u.end_v;
  }
  m.filtered_v = {.a = filtered_v[0], .b = filtered_v[1], .c = filtered_v[2]};
}

double Comparators::away_v(const ComparatorMemory& m, int terminal, const Span& span) const noexcept {
  const double half_v = 0.5 * p_.hysteresis_v;
  const double added_v = offset_v(terminal);
  return (m.levels >> terminal & 1U) != 0 ? span.lowest_v + added_v + half_v
                                          : half_v - span.highest_v - added_v;
}

bool Comparators::is_out_of_reach(double away_v) const noexcept {
  return !(away_v < kMostNoise * p_.noise_rms_v);
}

/// The noise changes at fixed instants of the tick, whatever the intervals are. Where it cannot bring the
/// input to its threshold, only how large it is at most is asked; once none can, the rest is skipped. A step
/// that would begin with the end of the interval, but for rounding, belongs to the next one.
void Comparators::switch_within(ComparatorMemory& m, const Place& place, const Input& input,
                                const Span& given) const noexcept {
  const double added_v = offset_v(place.terminal);
  if (p_.noise_rms_v == 0.0) return switch_within(m, place, input, added_v, 0.0, 1.0);
  const NoiseChannel noise = noise_[index_of(place.terminal)];
  constexpr double kSameInstant = 1e-9;  // in steps
  const double steps = place.duration_s / noise_step_s_;
  const double part = 1.0 / steps;
  const double begun = place.start_s / noise_step_s_;
  std::int64_t step = floor_to_integer(begun + kSameInstant);
  double largest = -1.0;  // draw of noise that reaches the threshold from where the input has come to
  for (double from = 0.0; from < 1.0; ++step) {
    const double until = static_cast<double>(step + 1) - begun;
    const double to = until < steps - kSameInstant ? until * part : 1.0;
    if (to <= from) continue;
    if (largest < 0.0) {
      const double missing_v = away_v(m, place.terminal, given.with(input.at(from)));
      if (is_out_of_reach(missing_v)) return;
      const double sigmas = missing_v / p_.noise_rms_v;
      largest = sigmas > 0.0 ? (1.0 + 1e-9) * exponential(-0.5 * sigmas * sigmas) : 1.0;
    }
    const auto number = static_cast<std::uint64_t>(place.tick * noise_steps_ + step);
    if (noise.draw(number) <= largest) {
      const double noise_v = p_.noise_rms_v * noise.gaussian(number);
      switch_within(m, place, input, added_v + noise_v, from, to);
      largest = -1.0;
    }
    from = to;
  }
}

void Comparators::switch_within(ComparatorMemory& m, const Place& place, const Input& input, double added_v,
                                double from, double to) const noexcept {
  const std::uint64_t bit = std::uint64_t{1} << place.terminal;
  const double half_v = 0.5 * p_.hysteresis_v;
  const auto beyond_v = [&]() noexcept { return (m.levels & bit) != 0 ? -half_v : half_v; };
  const auto is_beyond = [&](double v) noexcept { return (m.levels & bit) != 0 ? v < -half_v : v > half_v; };
  const auto switch_at = [&](double t) noexcept {
    m.levels ^= bit;
    ++m.edges[index_of(place.terminal)];
    m.edge_tick[index_of(place.terminal)] = place.tick;
    const double at_s = place.start_s + t * place.duration_s;
    m.edge_s[index_of(place.terminal)] = at_s;
    if (place.log == nullptr) return;
    place.log->add({.at_s = at_s,
                    .kind = EventKind::kComparator,
                    .channel = static_cast<std::uint32_t>(place.terminal),
                    .level = (m.levels & bit) != 0 ? 1U : 0U});
  };
  double v = input.at(from) + added_v;
  if (is_beyond(v)) switch_at(from);  // a jump of the voltage or of the noise
  const Input::Runs runs = input.runs(from, to);
  for (std::size_t n = 1; n < runs.count; ++n) {
    const double end_v = input.at(runs.instant[n]) + added_v;
    if (is_beyond(end_v)) {
      const double threshold_v = beyond_v();
      switch_at(input.passes(threshold_v - added_v, runs.instant[n - 1], v - threshold_v, runs.instant[n],
                             end_v - threshold_v));
    }
    v = end_v;
  }
}

void Comparators::read(const ComparatorMemory& m, Tick tick, Sample& sample) const noexcept {
  if (!p_.enabled) return;
  const auto age_s = [&](std::size_t k) noexcept {
    return static_cast<double>(tick - m.edge_tick[k]) * period_s_ - m.edge_s[k];
  };
  sample.comparator_levels = m.levels;
  sample.comparator_a_edges = m.edges[0];
  sample.comparator_b_edges = m.edges[1];
  sample.comparator_c_edges = m.edges[2];
  sample.comparator_a_age_s = age_s(0);
  sample.comparator_b_age_s = age_s(1);
  sample.comparator_c_age_s = age_s(2);
  sample.comparator_a_v = m.filtered_v.a;
  sample.comparator_b_v = m.filtered_v.b;
  sample.comparator_c_v = m.filtered_v.c;
}

}  // namespace drivebench
