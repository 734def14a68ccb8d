#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "clients/regression/checks/check_kinds.hpp"
#include "clients/regression/checks/harmonics.hpp"

/// Checks on the spectrum of a signal in a window.
namespace drivebench::regression {
namespace {

constexpr double kDefaultHarmonics = 40.0;  ///< those of IEC 61000-3-2
constexpr double kMostHarmonics = 100.0;
constexpr double kMostSamples = 1e6;
/// A given fundamental needs so many periods, so that neighbouring harmonics are told apart with noise; one
/// that has to be found, so many that its frequency is right to a ten-thousandth of the window's inverse.
constexpr double kFewestPeriods = 3.0;
constexpr double kFewestPeriodsToFind = 8.0;

int harmonics_of(const CheckSpec& spec) {
  return static_cast<int>(spec.number_or("harmonics", kDefaultHarmonics));
}

/// The most samples that the window can have, as a number that may be infinite.
double most_samples(const CheckSpec& spec, const RunFacts& facts) {
  const bool is_open = facts.end_tick == RunFacts{}.end_tick && !spec.to_s;
  if (is_open) return kInfinite;
  const double to_ticks = spec.to_s ? *spec.to_s / facts.period_s : static_cast<double>(facts.end_tick);
  return std::floor(to_ticks - spec.from_s / facts.period_s + 0.5) + 1.0;
}

/// The reason why so many samples of a fundamental have no harmonics; empty: they have.
std::string problem_with_periods(const CheckSpec& spec, double samples, double frequency_hz,
                                 double period_s) {
  const double fewest = spec.number("fundamental_hz") ? kFewestPeriods : kFewestPeriodsToFind;
  const double periods = samples * period_s * frequency_hz;
  if (periods < fewest) {
    return fmt::format("has a window of {:.3g} periods of {:.6g} Hz but must have {:g}", periods,
                       frequency_hz, fewest);
  }
  const double samples_of_period = 1.0 / (period_s * frequency_hz);
  if (samples_of_period < 2.0 * harmonics_of(spec) + 1.0) {
    return fmt::format("has {:.4g} samples in a period of {:.6g} Hz, too few for {} harmonics",
                       samples_of_period, frequency_hz, harmonics_of(spec));
  }
  return {};
}

/// The root of the sum of the squares of the harmonics over the fundamental.
class Thd final : public Check {
 public:
  Thd(const CheckSpec& spec, const RunFacts& facts) : Check(spec, facts) {
    values_.reserve(static_cast<std::size_t>(std::min(most_samples(spec, facts), kMostSamples)));
  }

 private:
  void take(const Sample&, double value) noexcept override {
    if (values_.size() < values_.capacity()) values_.push_back(value);
  }

  Outcome outcome() const override {
    const double limit = spec().number_or("max_percent", 0.0);
    const std::optional<double> given_hz = spec().number("fundamental_hz");
    const std::optional<double> found = given_hz ? *given_hz * seconds(1) : fundamental_of(values_);
    if (!found) return without("no fundamental: the signal does not rise twice", limit);
    const double frequency_hz = *found / seconds(1);
    const auto samples = static_cast<double>(values_.size());
    const std::string problem = problem_with_periods(spec(), samples, frequency_hz, seconds(1));
    if (!problem.empty()) return without(problem, limit);
    const std::vector<double> amplitudes = harmonic_amplitudes(values_, *found, harmonics_of(spec()));
    double squares = 0.0;
    for (std::size_t n = 2; n < amplitudes.size(); ++n)
      squares += amplitudes[n] * amplitudes[n];
    if (!(amplitudes[1] > 0.0)) return without("no fundamental: its amplitude is 0", limit);
    // Rounded, because the last bits of a sine depend on the processor, and reports do not.
    const double percent = std::round(1e11 * std::sqrt(squares) / amplitudes[1]) * 1e-9;
    return {
        .passed = percent <= limit,
        .measured = percent,
        .limit = limit,
        .worst_tick = first_tick(),
        .unit = "%",
        .sentence = fmt::format("thd {:.4g} % of {} at {:.6g} Hz, {} harmonics, max {:.4g} %", percent,
                                with_unit(amplitudes[1], unit()), frequency_hz, harmonics_of(spec()), limit)};
  }

  Outcome without(std::string why, double limit) const {
    return {.passed = false,
            .measured = kInfinite,
            .limit = limit,
            .worst_tick = first_tick(),
            .unit = "%",
            .sentence = std::move(why)};
  }

  std::vector<double> values_;
};

std::string problem_with_thd(const CheckSpec& spec) {
  const double harmonics = spec.number_or("harmonics", kDefaultHarmonics);
  return harmonics == std::floor(harmonics) ? "" : "has harmonics that are no whole number";
}

std::string problem_with_thd_on_bench(const CheckSpec& spec, const RunFacts& facts) {
  const double samples = most_samples(spec, facts);
  if (samples == kInfinite) return "needs to_s, because the case has no duration_s";
  if (samples > kMostSamples) {
    return fmt::format("has a window of {:.0f} samples but {:.0f} are the most", samples, kMostSamples);
  }
  const std::optional<double> given_hz = spec.number("fundamental_hz");
  return given_hz ? problem_with_periods(spec, samples, *given_hz, facts.period_s) : std::string();
}

constexpr auto kThd = std::to_array<NumberKey>({{"max_percent", true, 0.0, 1e6},
                                                {"fundamental_hz", false, 1e-6, 1e9},
                                                {"harmonics", false, 2.0, kMostHarmonics}});

}  // namespace

std::span<const CheckKind> spectrum_checks() noexcept {
  static constexpr auto kKinds = std::to_array<CheckKind>(
      {{"thd", Watches::kSignal, false, kThd, problem_with_thd, make_check<Thd>, problem_with_thd_on_bench}});
  return kKinds;
}

}  // namespace drivebench::regression
