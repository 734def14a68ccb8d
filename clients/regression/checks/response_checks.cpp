#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>
#include <vector>

#include "clients/regression/checks/check_kinds.hpp"
#include "clients/regression/checks/frequency_response.hpp"
#include "plant/math/phasor.hpp"
#include "plant/math/trig.hpp"

/// Checks on the answer to a multisine.
namespace drivebench::regression {
namespace {

using Complex = std::complex<double>;

constexpr double kLongestPeriod = 1e6;   ///< [ticks], of which a table of cosines is kept
constexpr double kFewestInjected = 3.0;  ///< one for transients to die, two that tell what is noise

/// A bound that a check may have: what it is about, and on which side of the limit the value must lie.
struct Bound {
  std::string_view key;
  std::string_view unit;
  bool is_minimum;
};
constexpr auto kLoopBounds = std::to_array<Bound>({{"min_gain_margin_db", "dB", true},
                                                   {"min_phase_margin_deg", "deg", true},
                                                   {"min_crossover_hz", "Hz", true},
                                                   {"max_crossover_hz", "Hz", false}});
constexpr auto kPointBounds = std::to_array<Bound>(
    {{"min_db", "dB", true}, {"max_db", "dB", false}, {"min_deg", "deg", true}, {"max_deg", "deg", false}});

/// Response by response over whole periods of the multisine.
///
/// Y and D are the Fourier sums of answer and injection at a line, G = Y/D, over the loop gain L = C·P that
/// is broken where the injection enters:
///
///   load torque (D opposes Y, the torque of the motor)  G = L/(1 + L)    L = G/(1 - G)
///   offset of the current sensors (D adds to Y)         G = -L/(1 + L)   L = -G/(1 + G)
///
/// The load in a sample is that of the tick before it: d(t) = D·sinc(f·T)·e^(jπfT) for the motor. The offset
/// is computed, because a sample shows it only within the measured current X = Y + D; so Y has gain, filter
/// and delay of the sensor in it, as the loop has. The standard error comes from the scatter of the periods,
/// Σ|Y - G·D|².
class FrequencyResponse final : public Check {
 public:
  FrequencyResponse(const CheckSpec& spec, const RunFacts& facts)
      : Check(spec, facts), lines_(spec.excitation->lines(facts.period_s)), list_(lines_of(lines_)) {
    const std::uint32_t period = lines_.period_ticks;
    turn_.reserve(period);
    for (std::uint32_t k = 0; k < period; ++k)
      turn_.push_back(phasor(-2.0 * std::numbers::pi * k / period));
    const auto ticks = [&facts](double s) { return std::llround(s / facts.period_s); };
    start_tick_ = ticks(spec.excitation->begin_s);
    if (spec.excitation->has_trigger) start_tick_ -= ticks(spec.from_s);  // both count from the trigger
  }

 private:
  /// The sums of a line over the present period, and over all that have ended.
  struct LineSums {
    std::uint64_t angle = 0;  ///< [2π/period]
    Complex y_now{};
    Complex d_now{};
    Complex y{};
    Complex d{};
    Complex y_d{};  ///< of Y·conj(D), period by period
    double y_squared = 0.0;
    double d_squared = 0.0;

    void end_period() noexcept {
      y += y_now;
      d += d_now;
      y_d += y_now * std::conj(d_now);
      y_squared += std::norm(y_now);
      d_squared += std::norm(d_now);
      y_now = d_now = 0.0;
    }
  };

  void take(const Sample& sample, double value) noexcept override {
    const bool is_load = spec().excitation->is_load;
    const double answer = spec().signal != nullptr ? value : is_load ? sample.torque_nm : sample.i_a_a;
    for (std::size_t j = 0; j < list_.count; ++j) {
      LineSums& line = sums_[j];
      line.y_now += answer * turn_[line.angle];
      if (is_load) line.d_now += sample.load_nm * turn_[line.angle];
      line.angle += list_.multiple[j];
      if (line.angle >= turn_.size()) line.angle -= turn_.size();
    }
    if (++samples_of_period_ < turn_.size()) return;
    samples_of_period_ = 0;
    ++periods_;
    for (std::size_t j = 0; j < list_.count; ++j) {
      LineSums& line = sums_[j];
      if (!is_load) line.d_now = offset_of(j);
      if (!is_load && spec().signal == nullptr) line.y_now -= line.d_now;
      line.end_period();
    }
  }

  /// The sum of a period of the offset, which in a sample is that of the tick before it.
  Complex offset_of(std::size_t j) const noexcept {
    const auto period = static_cast<std::int64_t>(turn_.size());
    const auto first = static_cast<std::int64_t>(first_tick());
    const std::int64_t since = spec().excitation->has_trigger ? -start_tick_ : first - start_tick_;
    const std::int64_t k = ((since - 1) % period + period) % period;
    const auto multiple = static_cast<std::int64_t>(list_.multiple[j]);
    const double turns = static_cast<double>(multiple * k % period) / static_cast<double>(period);
    return phasor(2.0 * std::numbers::pi * (turns - line_phase(j) - 0.25),
                  0.5 * spec().excitation->amplitude * static_cast<double>(period));
  }

  ResponsePoint point_of(std::size_t j) const {
    const LineSums& line = sums_[j];
    const double turns_a_tick = static_cast<double>(list_.multiple[j]) / lines_.period_ticks;
    const bool is_load = spec().excitation->is_load;
    const double half_turn = std::numbers::pi * turns_a_tick;
    const Complex hold = is_load ? phasor(half_turn, sine(half_turn) / half_turn) : Complex(1.0);
    const Complex in_samples = quotient(line.y, line.d);
    const double scatter = line.y_squared + std::norm(in_samples) * line.d_squared -
                           2.0 * (std::conj(in_samples) * line.y_d).real();
    const double count = periods_;
    const double error = std::sqrt(std::max(scatter, 0.0) * count / (count - 1.0)) / magnitude(line.d);
    const Complex g = quotient(in_samples, hold);
    const double sign = is_load ? 1.0 : -1.0;
    const Complex loop = quotient(sign * g, 1.0 - sign * g);
    const Complex response = spec().signal != nullptr ? g : loop;
    const double steepness = spec().signal != nullptr ? 1.0 : 1.0 / std::norm(1.0 - sign * g);
    return {.hz = turns_a_tick / seconds(1),
            .gain_db = 20.0 * logarithm(magnitude(response)) / std::numbers::ln10,
            .phase_deg = argument(response) * 180.0 / std::numbers::pi,
            .error = error / magnitude(hold) * steepness / magnitude(response)};
  }

  Outcome outcome() const override {
    if (periods_ < 2) {
      return without(
          fmt::format("the window has {} whole periods of the multisine, but must have 2", periods_));
    }
    std::vector<ResponsePoint> points;
    for (std::size_t j = 0; j < list_.count; ++j) {
      points.push_back(point_of(j));
      if (!std::isfinite(points.back().gain_db) || !std::isfinite(points.back().error)) {
        return without(fmt::format("no answer to the multisine at {:.6g} Hz", points.back().hz));
      }
    }
    unwrap(points);
    const std::vector<ResponsePoint> read = readable(points);
    Outcome found = read.size() < 2
                        ? without("all lines are lost in noise: a larger amplitude, or more periods")
                    : spec().number("at_hz") ? at_a_point(read)
                                             : of_the_loop(read);
    if (read.size() < points.size()) {
      found.sentence +=
          fmt::format("; {} of {} lines are lost in noise", points.size() - read.size(), points.size());
    }
    found.response = std::move(points);
    return found;
  }

  /// The first bound that is broken decides, or else the first that there is.
  template <class ValueOf>
  Outcome judged(std::span<const Bound> bounds, std::string text, ValueOf value_of) const {
    Outcome found = without("");
    bool is_first = true;
    for (const Bound& bound : bounds) {
      const std::optional<double> limit = spec().number(bound.key);
      if (!limit) continue;
      const std::optional<double> value = value_of(bound.key);
      const bool holds = value && (bound.is_minimum ? *value >= *limit : *value <= *limit);
      if (!holds) {
        text += fmt::format(", {} {:.6g} {}", bound.is_minimum ? "min" : "max", *limit, bound.unit);
      }
      if (is_first || (!holds && found.passed)) {
        found.passed = holds;
        found.measured = value.value_or(bound.is_minimum ? -kInfinite : kInfinite);
        found.limit = *limit;
        found.unit = bound.unit;
      }
      is_first = false;
    }
    found.sentence = std::move(text);
    return found;
  }

  Outcome of_the_loop(const std::vector<ResponsePoint>& read) const {
    const LoopMargins m = margins_of(read);
    const std::string range = fmt::format("between {:.4g} and {:.4g} Hz", read.front().hz, read.back().hz);
    const std::string text =
        (m.crossover ? fmt::format("phase margin {:.2f} deg, crossover {:.5g} Hz", m.phase_margin_deg,
                                   m.crossover->hz)
                     : "no crossover " + range) +
        (m.reversal ? fmt::format(", gain margin {:.2f} dB at {:.5g} Hz", m.gain_margin_db, m.reversal->hz)
                    : ", the phase does not cross -180 deg " + range);
    return judged(kLoopBounds, text, [&m](std::string_view key) -> std::optional<double> {
      if (key == "min_gain_margin_db")
        return m.reversal ? std::optional(std::abs(m.gain_margin_db)) : std::nullopt;
      if (!m.crossover) return std::nullopt;
      return key == "min_phase_margin_deg" ? m.phase_margin_deg : m.crossover->hz;
    });
  }

  Outcome at_a_point(const std::vector<ResponsePoint>& read) const {
    const double hz = *spec().number("at_hz");
    const std::optional<ResponseAt> at = response_at(read, hz);
    if (!at) {
      return without(fmt::format("no lines around {:.6g} Hz: they go from {:.6g} to {:.6g} Hz", hz,
                                 read.front().hz, read.back().hz));
    }
    const std::string text =
        fmt::format("{:.3f} dB and {:.3f} deg at {:.6g} Hz", at->gain_db, at->phase_deg, hz);
    return judged(kPointBounds, text, [&at](std::string_view key) -> std::optional<double> {
      return key.ends_with("_db") ? at->gain_db : at->phase_deg;
    });
  }

  Outcome without(std::string why) const {
    return {.passed = false,
            .measured = std::nan(""),
            .limit = std::nan(""),
            .worst_tick = first_tick(),
            .unit = "",
            .sentence = std::move(why)};
  }

  MultisineLines lines_;
  LineList list_;
  std::vector<Complex> turn_;  ///< exp(-j·2π·k/period)
  std::array<LineSums, kMostMultisineLines + 1> sums_{};
  std::int64_t start_tick_ = 0;  ///< of the multisine; with a trigger, counted from the first of the window
  std::size_t samples_of_period_ = 0;
  int periods_ = 0;
};

bool has_any(const CheckSpec& spec, std::span<const Bound> bounds) {
  return std::ranges::any_of(bounds,
                             [&spec](const Bound& bound) { return spec.number(bound.key).has_value(); });
}

std::string problem_with_response(const CheckSpec& spec) {
  const bool is_point = spec.number("at_hz").has_value();
  if (has_any(spec, kPointBounds) != is_point) {
    return "has at_hz without a bound of gain or phase there, or the other way round";
  }
  if (!is_point && !has_any(spec, kLoopBounds)) return "has no bound, such as min_phase_margin_deg";
  if (has_any(spec, kLoopBounds) && (is_point || spec.signal != nullptr)) {
    return "has bounds of a loop beside at_hz or signal: give each a check";
  }
  return {};
}

std::string problem_with_response_on_bench(const CheckSpec& spec, const RunFacts& facts) {
  const MultisineLines lines = spec.excitation->lines(facts.period_s);
  if (!are_possible(lines)) return "has a step with a multisine that the bench does not have";
  if (lines.period_ticks > kLongestPeriod) {
    return fmt::format("has a multisine with a period of {} ticks but {:.0f} are the most",
                       lines.period_ticks, kLongestPeriod);
  }
  if (spec.excitation->periods < kFewestInjected) {
    return fmt::format("has a multisine of {:.0f} periods but must have {:.0f}: the first is not measured",
                       spec.excitation->periods, kFewestInjected);
  }
  return {};
}

constexpr auto kResponse = std::to_array<NumberKey>({{"min_gain_margin_db", false, 0.0, 1000.0},
                                                     {"min_phase_margin_deg", false, 0.0, 180.0},
                                                     {"min_crossover_hz", false, 0.0, 1e9},
                                                     {"max_crossover_hz", false, 0.0, 1e9},
                                                     {"at_hz", false, 1e-9, 1e9},
                                                     {"min_db", false, -1000.0, 1000.0},
                                                     {"max_db", false, -1000.0, 1000.0},
                                                     {"min_deg", false, -1e5, 1e5},
                                                     {"max_deg", false, -1e5, 1e5}});

}  // namespace

std::span<const CheckKind> response_checks() noexcept {
  static constexpr auto kKinds = std::to_array<CheckKind>(
      {{"frequency_response", Watches::kResponse, false, kResponse, problem_with_response,
        make_check<FrequencyResponse>, problem_with_response_on_bench}});
  return kKinds;
}

}  // namespace drivebench::regression
