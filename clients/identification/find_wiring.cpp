#include "clients/identification/find_wiring.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "clients/identification/identify.hpp"
#include "clients/identification/motors/terminal_voltages.hpp"
#include "clients/identification/wiring/flux_equations.hpp"

namespace drivebench::identification {
namespace {

constexpr double kOf95 = 1.96;
constexpr int kMostPolePairs = 100;
constexpr int kMostInductionPairs = 16;
/// The square sum of a hypothesis over that of the best: beyond it the hypothesis is out, as the rms of what
/// it leaves is twice as large over some thousand windows.
constexpr double kOut = 4.0;
constexpr double kUnexplained = 0.1;  ///< what the best may leave of the voltages, by square sum
constexpr std::size_t kMostContenders = 4;
constexpr std::size_t kContestSamples = 10'000;
constexpr std::size_t kShiftSamples = 5'000;
constexpr int kMostHalfSteps = 12;
/// Of -2 ln(likelihood): e^20 to 1.
constexpr double kDecisive = 40.0;
constexpr double kTellsHalfSamples = 0.2;  ///< half of the interval of a shift that is worth a statement
constexpr double kNearHalf = 0.1;          ///< a shift this near to a half sample is that
constexpr double kSlackShift = 0.15;
constexpr double kHalfStep = 0.25;  ///< half of the interval of a shift that is one of the half samples
constexpr double kSlackZero_rad = 0.05;

/// A number of pole pairs, negative where the encoder counts against the phases.
struct Hypothesis {
  int turn;
  FluxFit fit;
};

bool has_magnet(MotorKind kind) {
  return kind == MotorKind::kPmSynchronous || kind == MotorKind::kBldc;
}

/// The shift on the grid of half samples that converters and amplifiers make, or as found beside it.
double usual_shift(const FluxFit& fit) {
  const double half = 0.5 * std::round(2.0 * fit.voltage_shift);
  const double near = std::max(kNearHalf, kOf95 * fit.shift_deviation);
  return std::abs(fit.voltage_shift - half) <= near ? half : fit.voltage_shift;
}

bool tells_shift(const FluxFit& fit) {
  return kOf95 * fit.shift_deviation < kTellsHalfSamples;
}

Settings with(const Settings& e, const Hypothesis& h, const GivenWiring& given) {
  Settings there = e;
  there.pole_pairs = std::abs(h.turn);
  there.reversed = h.turn < 0;
  if (has_magnet(e.kind) && !given.zero) there.zero_rad = h.fit.zero_rad / there.pole_pairs;
  if (!given.voltage_shift && tells_shift(h.fit)) there.processing.voltage_shift = usual_shift(h.fit);
  return there;
}

/// All hypotheses, the best first. An electrical turn has six samples at least.
std::vector<Hypothesis> ranked(const FluxEquations& equations, MotorKind kind, bool salient) {
  int most = kind == MotorKind::kDc          ? 1
             : kind == MotorKind::kInduction ? kMostInductionPairs
                                             : kMostPolePairs;
  if (equations.fastest_rad() > 0.0)
    most = std::clamp(static_cast<int>(1.0 / equations.fastest_rad()), 1, most);
  std::vector<Hypothesis> all;
  for (int turn = -most; turn <= most; ++turn) {
    if (turn != 0) all.push_back({turn, equations.fit(turn, salient)});
  }
  std::ranges::stable_sort(all, {}, [](const Hypothesis& h) { return h.fit.square_sum; });
  return all;
}

/// Whether a rotor of a PM synchronous motor is salient: the best hypothesis then leaves clearly less than
/// the best one of a round rotor, whose equations determine more where they hold.
bool has_saliency(const std::vector<Hypothesis>& salient, const std::vector<Hypothesis>& round) {
  constexpr double kClearly = 0.9;
  return salient.front().fit.square_sum < kClearly * round.front().fit.square_sum;
}

/// The settings with the part of the window, of so many samples, in which the voltages change most.
Settings busiest_part(const MeasuredData& data, Settings e, std::size_t samples) {
  const SampleRange range = window_of(data, e.processing);
  if (range.count() <= samples) return e;
  std::size_t best = range.first;
  double most = 0.0;
  for (std::size_t first = range.first; first + samples <= range.end; first += samples / 4) {
    double sum = 0.0;
    for (std::size_t phase = 0; phase < phases_of(e); ++phase) {
      const SeriesView u = data.at(std::string("u_") + static_cast<char>('a' + phase) + "_v");
      for (std::size_t k = first + 1; k < first + samples; ++k)
        sum += (u[k] - u[k - 1]) * (u[k] - u[k - 1]);
    }
    constexpr double kClearly = 1.2;
    if (sum <= kClearly * most) continue;
    most = sum;
    best = first;
  }
  e.processing.from_s = data.period_s * static_cast<double>(best);
  e.processing.to_s = data.period_s * static_cast<double>(best + samples);
  return e;
}

/// -2 ln(likelihood) of the motor refined under a hypothesis.
double unlikelihood(const MeasuredData& data, const Settings& e) {
  try {
    const Result result = identify(data, e);
    if (result.explanation) return result.explanation->unlikelihood;
  } catch (const IdentificationError&) {
    // no motor under this hypothesis
  }
  return std::numeric_limits<double>::infinity();
}

/// The hypothesis that the record shows, or why it shows none.
struct Decision {
  std::optional<Hypothesis> chosen{};
  std::string why_not{};
};

std::string turns_text(const std::vector<Hypothesis>& hypotheses) {
  std::string text;
  for (const Hypothesis& h : hypotheses)
    text += fmt::format("{}{}{}", text.empty() ? "" : ", ", std::abs(h.turn), h.turn < 0 ? " reversed" : "");
  return text;
}

Decision decide(const MeasuredData& data, const Settings& e, const GivenWiring& given,
                std::vector<Hypothesis> contenders) {
  const double least = contenders.front().fit.square_sum;
  if (contenders.front().fit.share > kUnexplained) return {{}, "no hypothesis explains the voltages"};
  std::erase_if(contenders, [&](const Hypothesis& h) { return !(h.fit.square_sum <= kOut * least); });
  if (contenders.size() > kMostContenders)
    return {{},
            fmt::format("{} hypotheses explain the record alike: it hardly shows the motor turning",
                        contenders.size())};
  if (contenders.size() == 1) return {contenders.front(), {}};
  const Settings part = busiest_part(data, e, kContestSamples);
  std::vector<std::pair<double, Hypothesis>> judged;
  judged.reserve(contenders.size());
  for (const Hypothesis& h : contenders)
    judged.emplace_back(unlikelihood(data, with(part, h, given)), h);
  std::ranges::stable_sort(judged, {}, &std::pair<double, Hypothesis>::first);
  if (judged[0].first + kDecisive < judged[1].first) return {judged[0].second, {}};
  return {{}, "alike: " + turns_text(contenders)};
}

/// The fit again with the whole samples of the shift taken off, until what is left is less than one.
FluxFit settled_fit(const MeasuredData& data, const Settings& e, const Hypothesis& h, bool salient) {
  FluxFit fit = h.fit;
  for (int round = 0; round < 3 && tells_shift(fit); ++round)
    fit = FluxEquations(data, e, static_cast<int>(std::floor(fit.voltage_shift))).fit(h.turn, salient);
  return fit;
}

/// The half sample whose motor, refined on so many samples, is likelier than those of both neighbours by
/// kDecisive; found by steps of half a sample from the nearest to `from`.
std::optional<double> likeliest_shift(const MeasuredData& data, const Settings& e, double from,
                                      std::size_t samples) {
  const Settings part = busiest_part(data, e, samples);
  std::map<int, double> known;
  const auto at = [&](int half) {
    const auto place = known.find(half);
    if (place != known.end()) return place->second;
    Settings there = part;
    there.processing.voltage_shift = 0.5 * half;
    return known[half] = unlikelihood(data, there);
  };
  int best = static_cast<int>(std::lround(2.0 * from));
  for (int step = 0; step < kMostHalfSteps; ++step) {
    const double below = at(best - 1);
    const double above = at(best + 1);
    if (at(best) + kDecisive < std::min(below, above)) return 0.5 * best;
    if (at(best) <= std::min(below, above)) return std::nullopt;
    best += below < above ? -1 : 1;
  }
  return std::nullopt;
}

WiringFact shift_fact(const MeasuredData& data, const FluxFit& fit, Settings& e, const GivenWiring& g) {
  WiringFact fact{.name = "voltage_shift", .unit = "periods", .given = g.voltage_shift};
  double& shift = e.processing.voltage_shift;
  double usual = shift;
  if (tells_shift(fit)) {
    fact.found = fit.voltage_shift;
    fact.interval = kOf95 * fit.shift_deviation;
    usual = usual_shift(fit);
  } else if (!g.by_bench) {
    const bool near = fit.shift_deviation < 1.0;
    const double from = near ? fit.voltage_shift : shift;
    fact.found = likeliest_shift(data, e, from, kShiftSamples);
    // What the part does not tell the whole record may: no motor is certified on a shift that it contradicts.
    if (!fact.found && !g.voltage_shift) fact.found = likeliest_shift(data, e, from, data.samples());
    fact.interval = kHalfStep;
    usual = fact.found.value_or(shift);
  }
  if (!fact.found) fact.remark = "the voltages change too slowly to tell";
  fact.contradicts =
      g.voltage_shift && fact.found && std::abs(*fact.found - shift) > std::max(fact.interval, kSlackShift);
  if (!g.voltage_shift) shift = usual;
  fact.used = shift;
  return fact;
}

WiringFact zero_fact(const FluxFit& fit, Settings& e, bool given) {
  WiringFact fact{.name = "zero", .unit = "rad electrical", .given = given};
  const double interval = kOf95 * fit.zero_deviation;
  const double off = std::remainder(fit.zero_rad - e.zero_rad * e.pole_pairs, 2.0 * std::numbers::pi);
  const bool is_elsewhere = std::abs(off) > interval + kSlackZero_rad;
  if (interval < std::numbers::pi) {
    fact.found = fit.zero_rad;
    fact.interval = interval;
  } else {
    fact.remark = "the motor hardly turns, and no induced voltage shows it";
  }
  fact.contradicts = given && is_elsewhere;
  if (!given) e.zero_rad = is_elsewhere ? fit.zero_rad / e.pole_pairs : 0.0;
  e.sensors.zero = !given;
  fact.used = e.zero_rad * e.pole_pairs;
  return fact;
}

}  // namespace

std::vector<WiringFact> find_wiring(const MeasuredData& data, Settings& e, const GivenWiring& given) {
  const FluxEquations equations(data, e, static_cast<int>(std::floor(e.processing.voltage_shift)));
  std::vector<Hypothesis> all = ranked(equations, e.kind, false);
  bool salient = false;
  if (e.kind == MotorKind::kPmSynchronous) {
    std::vector<Hypothesis> others = ranked(equations, e.kind, true);
    salient = has_saliency(others, all);
    if (salient) all.swap(others);
  }
  Decision decision = decide(data, e, given, all);
  const bool dc = e.kind == MotorKind::kDc;
  WiringFact pairs{.name = "pole_pairs", .unit = "1", .given = given.pole_pairs};
  WiringFact direction{.name = "direction", .unit = "1", .given = given.direction};
  if (decision.chosen) {
    pairs.found = std::abs(decision.chosen->turn);
  } else {
    pairs.remark = direction.remark = decision.why_not;
    std::vector<Hypothesis> both;
    std::ranges::copy_if(all, std::back_inserter(both),
                         [&](const Hypothesis& h) { return std::abs(h.turn) == e.pole_pairs; });
    if (given.pole_pairs && !both.empty()) decision = decide(data, e, given, both);
  }
  pairs.contradicts = given.pole_pairs && pairs.found && *pairs.found != e.pole_pairs;
  if (decision.chosen) {
    direction.found = decision.chosen->turn < 0 ? -1.0 : 1.0;
    direction.contradicts = given.direction && (*direction.found < 0.0) != e.reversed;
    direction.remark = *direction.found < 0.0 && !dc ? "a reversed encoder or two crossed phases" : "";
    if (!given.pole_pairs) e.pole_pairs = std::abs(decision.chosen->turn);
    if (!given.direction) e.reversed = decision.chosen->turn < 0;
  }
  pairs.used = e.pole_pairs;
  direction.used = e.reversed ? -1.0 : 1.0;
  std::vector<WiringFact> facts;
  if (!dc) facts.push_back(std::move(pairs));
  facts.push_back(std::move(direction));
  if (!decision.chosen) {
    facts.push_back({.name = "voltage_shift",
                     .unit = "periods",
                     .used = e.processing.voltage_shift,
                     .given = given.voltage_shift,
                     .remark = "the data do not tell"});
    return facts;
  }
  const FluxFit fit = settled_fit(data, e, *decision.chosen, salient);
  std::optional<WiringFact> zero;
  if (has_magnet(e.kind)) zero = zero_fact(fit, e, given.zero);
  facts.push_back(shift_fact(data, fit, e, given));
  if (zero) facts.push_back(*std::move(zero));
  return facts;
}

}  // namespace drivebench::identification
