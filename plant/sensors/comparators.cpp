#include "plant/sensors/comparators.hpp"

#include <algorithm>
#include <cmath>

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

/// The instant between two at which f is zero, found to 1e-14 of its size at their ends.
template <class F>
double zero_between(const F& f, double from_s, double from_value, double to_s, double to_value) noexcept {
  constexpr int kMaxGuesses = 60;
  Bracket bracket{.low = from_s, .low_value = from_value, .high = to_s, .high_value = to_value};
  const double close_enough = 1e-14 * (std::abs(from_value) + std::abs(to_value));
  double at_s = from_s;
  for (int guess = 0; guess < kMaxGuesses; ++guess) {
    at_s = bracket.guess();
    const double value = f(at_s);
    if (std::abs(value) <= close_enough) break;
    bracket.narrow(at_s, value);
  }
  return at_s;
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

/// What a comparator sees t after the start of an interval. With u = u0 + u1 t + u2 t² before the RC,
///   RC y' = u - y     y = (u0 - u1 RC + 2 u2 RC²) + (u1 - 2 u2 RC) t + u2 t² + C e^(-t/RC)
class Comparators::Input {
 public:
  Input(const Difference& u, double duration_s) noexcept
      : constant_v_(u.start_v),
        slope_((4.0 * u.middle_v - 3.0 * u.start_v - u.end_v) / duration_s),
        curve_(2.0 * (u.start_v - 2.0 * u.middle_v + u.end_v) / (duration_s * duration_s)) {}

  void filter(double rc_s, double filtered_v) noexcept {
    constant_v_ += rc_s * (2.0 * curve_ * rc_s - slope_);
    slope_ -= 2.0 * curve_ * rc_s;
    transient_v_ = filtered_v - constant_v_;
    rate_per_s_ = 1.0 / rc_s;
  }

  double at(double t) const noexcept { return along(t) + (filters() ? transient_v_ * decay(t) : 0.0); }
  /// The same where e^(-t/RC) is known.
  double at(double t, double decay) const noexcept { return along(t) + transient_v_ * decay; }

  /// The instants between which it rises or falls all the time: `from_s`, those where it turns, `to_s`.
  struct Runs {
    std::array<double, 4> instant_s;
    std::size_t count = 0;
    void add(double t) noexcept { instant_s[count++] = t; }
  };
  Runs runs(double from_s, double to_s) const noexcept {
    Runs result;
    result.add(from_s);
    if (keeps_direction(from_s, to_s)) {
      result.add(to_s);
      return result;
    }
    const double bend_s = bend();
    if (bend_s > from_s && bend_s < to_s) {
      add_turn(from_s, bend_s, result);
      add_turn(bend_s, to_s, result);
    } else {
      add_turn(from_s, to_s, result);
    }
    result.add(to_s);
    return result;
  }

 private:
  bool filters() const noexcept { return rate_per_s_ > 0.0; }
  /// Whether parabola and transient go the same way, so that it turns nowhere: no exponential is needed.
  bool keeps_direction(double from_s, double to_s) const noexcept {
    const double from = slope_ + 2.0 * curve_ * from_s;
    const double to = slope_ + 2.0 * curve_ * to_s;
    const double settling = filters() ? -transient_v_ : 0.0;
    return (from >= 0.0 && to >= 0.0 && settling >= 0.0) || (from <= 0.0 && to <= 0.0 && settling <= 0.0);
  }
  double along(double t) const noexcept { return constant_v_ + t * (slope_ + t * curve_); }
  /// Asked for an instant several times, the last two are kept.
  double decay(double t) const noexcept {
    if (t == 0.0) return 1.0;
    if (t == newest_.at_s) return newest_.decay;
    if (t == older_.at_s) return older_.decay;
    older_ = newest_;
    newest_ = {.at_s = t, .decay = exponential(-rate_per_s_ * t)};
    return newest_.decay;
  }
  double slope(double t) const noexcept {
    return slope_ + 2.0 * curve_ * t - (filters() ? rate_per_s_ * transient_v_ * decay(t) : 0.0);
  }
  /// Where the slope itself turns; before the interval if it does not.
  double bend() const noexcept {
    const double bending = rate_per_s_ * rate_per_s_ * transient_v_;
    if (bending == 0.0) return -1.0;
    const double ratio = -2.0 * curve_ / bending;
    return ratio > 0.0 && std::isfinite(ratio) ? -logarithm(ratio) / rate_per_s_ : -1.0;
  }
  /// Between two instants the slope rises or falls all the time: it is zero at most once.
  void add_turn(double from_s, double to_s, Runs& runs) const noexcept {
    const double from = slope(from_s);
    const double to = slope(to_s);
    if (!(from * to < 0.0)) return;
    const auto slope_at = [this](double t) noexcept { return slope(t); };
    runs.add(zero_between(slope_at, from_s, from, to_s, to));
  }

  double constant_v_;
  double slope_;
  double curve_;
  double transient_v_ = 0.0;
  double rate_per_s_ = 0.0;
  struct Decay {
    double at_s = 0.0;
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
  const double decay = filters ? exponential(-duration_s / p_.rc_s) : 0.0;
  std::array<double, 3> filtered_v{m.filtered_v.a, m.filtered_v.b, m.filtered_v.c};
  for (int k = 0; k < 3; ++k) {
    const Difference u{.start_v = of(path.start_v, k) - reference.a,
                       .middle_v = of(path.middle_v, k) - reference.b,
                       .end_v = of(path.end_v, k) - reference.c};
    Input input(u, duration_s);
    double& y = filtered_v[index_of(k)];
    const double before_v = filters ? y : u.start_v;
    if (filters) input.filter(p_.rc_s, y);
    const auto [lowest_v, highest_v] = std::minmax({u.start_v, u.control_v(), u.end_v});
    const Span given{.lowest_v = lowest_v, .highest_v = highest_v};
    if (!is_out_of_reach(away_v(m, k, given.with(before_v)))) {
      switch_within(m, {k, tick, start_s, log}, input, given, duration_s);
    }
    y = filters ? input.at(duration_s, decay) : u.end_v;
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
/// input to its threshold, only how large it is at most is asked; once none can, the rest is skipped.
void Comparators::switch_within(ComparatorMemory& m, const Place& place, const Input& input,
                                const Span& given, double duration_s) const noexcept {
  const double added_v = offset_v(place.terminal);
  if (p_.noise_rms_v == 0.0) return switch_within(m, place, input, added_v, 0.0, duration_s);
  const NoiseChannel noise = noise_[index_of(place.terminal)];
  const double step_s = period_s_ / static_cast<double>(noise_steps_);
  std::int64_t step = floor_to_integer(place.start_s / step_s + 1e-9);
  double largest = -1.0;  // draw of noise that reaches the threshold from where the input has come to
  for (double from_s = 0.0; from_s < duration_s; ++step) {
    const double to_s = std::min(duration_s, static_cast<double>(step + 1) * step_s - place.start_s);
    if (to_s <= from_s) continue;
    if (largest < 0.0) {
      const double missing_v = away_v(m, place.terminal, given.with(input.at(from_s)));
      if (is_out_of_reach(missing_v)) return;
      const double sigmas = missing_v / p_.noise_rms_v;
      largest = sigmas > 0.0 ? (1.0 + 1e-9) * exponential(-0.5 * sigmas * sigmas) : 1.0;
    }
    const auto number = static_cast<std::uint64_t>(place.tick * noise_steps_ + step);
    if (noise.draw(number) <= largest) {
      const double noise_v = p_.noise_rms_v * noise.gaussian(number);
      switch_within(m, place, input, added_v + noise_v, from_s, to_s);
      largest = -1.0;
    }
    from_s = to_s;
  }
}

void Comparators::switch_within(ComparatorMemory& m, const Place& place, const Input& input, double added_v,
                                double from_s, double to_s) const noexcept {
  const std::uint64_t bit = std::uint64_t{1} << place.terminal;
  const double half_v = 0.5 * p_.hysteresis_v;
  const auto beyond_v = [&]() noexcept { return (m.levels & bit) != 0 ? -half_v : half_v; };
  const auto is_beyond = [&](double v) noexcept { return (m.levels & bit) != 0 ? v < -half_v : v > half_v; };
  const auto switch_at = [&](double t) noexcept {
    m.levels ^= bit;
    ++m.edges[index_of(place.terminal)];
    m.edge_tick[index_of(place.terminal)] = place.tick;
    m.edge_s[index_of(place.terminal)] = place.start_s + t;
    if (place.log == nullptr) return;
    place.log->add({.at_s = place.start_s + t,
                    .kind = EventKind::kComparator,
                    .channel = static_cast<std::uint32_t>(place.terminal),
                    .level = (m.levels & bit) != 0 ? 1U : 0U});
  };
  double v = input.at(from_s) + added_v;
  if (is_beyond(v)) switch_at(from_s);  // a jump of the voltage or of the noise
  const Input::Runs runs = input.runs(from_s, to_s);
  for (std::size_t n = 1; n < runs.count; ++n) {
    const double run_s = runs.instant_s[n];
    const double end_v = input.at(run_s) + added_v;
    if (is_beyond(end_v)) {
      const double threshold_v = beyond_v();
      const auto above_v = [&](double t) noexcept { return input.at(t) + added_v - threshold_v; };
      switch_at(zero_between(above_v, runs.instant_s[n - 1], v - threshold_v, run_s, end_v - threshold_v));
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
