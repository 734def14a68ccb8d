#pragma once

#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

namespace drivebench::control {

/// A number of a preset that its user may change.
struct Gain {
  std::string name;  ///< like "current.proportional_v_per_a": unit at the end
  double value;
};

/// What a run may last, with all that stands before and after its move.
inline constexpr double kLongestRun_s = 3600.0;

/// What a gain must be, beside finite. A duration is positive and a pause may be 0; neither is longer than
/// the longest run.
enum class GainRule { kAny, kPositive, kNotNegative, kDuration, kPause };

/// One row of the gain table of a parameter struct P: how to reach the number, and its rule. Every parameter
/// struct has `static std::span<const GainRow<P>> gains() noexcept` and `std::vector<std::string> problems()
/// const`; the latter starts from range_problems(*this), adds the rules between numbers, and every sentence
/// begins with the name of a gain.
template <class P>
struct GainRow {
  std::string_view name;
  double& (*of)(P&);
  GainRule rule = GainRule::kAny;
};

/// What is wrong with this number, a sentence; empty if nothing is.
std::string problem_with_gain(std::string_view name, double value, GainRule rule);

/// Every number of p that breaks the rule of its row, one sentence each.
template <class P>
std::vector<std::string> range_problems(P p) {
  std::vector<std::string> found;
  for (const GainRow<P>& row : P::gains()) {
    std::string problem = problem_with_gain(row.name, row.of(p), row.rule);
    if (!problem.empty()) found.push_back(std::move(problem));
  }
  return found;
}

/// The rows of the parts as they stand, one part after the other: names must differ between parts.
template <class... Parts>
std::vector<Gain> gains_of(Parts... parts) {
  std::vector<Gain> result;
  const auto append = [&result]<class P>(P& p) {
    for (const GainRow<P>& row : P::gains())
      result.push_back({std::string(row.name), row.of(p)});
  };
  (append(parts), ...);
  return result;
}

namespace gains_detail {

template <class P>
bool set_gain(P& p, const Gain& gain) {
  for (const GainRow<P>& row : P::gains()) {
    if (row.name != gain.name) continue;
    row.of(p) = gain.value;
    return true;
  }
  return false;
}

/// Throw std::invalid_argument.
[[noreturn]] void refuse_unknown(const Gain& gain, const std::vector<Gain>& known);
void refuse_problems(const std::vector<std::string>& problems, const std::vector<Gain>& values);

}  // namespace gains_detail

/// The parts with the overrides in place. Throws std::invalid_argument that names gain, value and rule, or
/// for an unknown name the nearest one.
///   const auto [controller, move] = with_gains(std::tuple{kController, kMove}, overrides);
template <class... Parts>
std::tuple<Parts...> with_gains(std::tuple<Parts...> parts, std::span<const Gain> overrides) {
  const auto present = [&parts] {
    return std::apply([](const auto&... each) { return gains_of(each...); }, parts);
  };
  for (const Gain& gain : overrides) {
    const bool found =
        std::apply([&gain](auto&... each) { return (gains_detail::set_gain(each, gain) || ...); }, parts);
    if (!found) gains_detail::refuse_unknown(gain, present());
  }
  std::vector<std::string> problems;
  const auto collect = [&problems](const std::vector<std::string>& found) {
    problems.insert(problems.end(), found.begin(), found.end());
  };
  std::apply([&collect](const auto&... each) { (collect(each.problems()), ...); }, parts);
  gains_detail::refuse_problems(problems, present());
  return parts;
}

template <class P>
P with_gains(P p, std::span<const Gain> overrides) {
  return std::get<0>(with_gains(std::tuple{std::move(p)}, overrides));
}

}  // namespace drivebench::control
