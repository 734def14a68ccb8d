#pragma once

#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

namespace drivebench::control {

/// A number of a preset that its user may change.
struct Gain {
  std::string name;  ///< like "current.proportional_v_per_a": unit at the end
  double value;
};

/// The longest a run may last, with all that stands before and after its move.
inline constexpr double kLongestRun_s = 3600.0;

/// The rule for a gain, which must be finite besides. A duration is positive and a pause may be 0; neither is
/// longer than the longest run.
enum class GainRule { kAny, kPositive, kNotNegative, kDuration, kPause };

/// One row of the gain table of a parameter struct P: a number, its name and its rule.
template <class P>
struct GainRow {
  std::string_view name;
  double P::*number;
  GainRule rule;

  template <class Owner, class Visit>
  constexpr void visit(Owner& p, const std::string& prefix, const Visit& see) const {
    see(prefix + std::string(name), p.*number, rule);
  }
};

/// The gain table of a parameter struct: rows in the order in which users see them. It stands in the struct
/// as `kGains`; a struct of clients/models has its own in gains/machine_gains.hpp.
template <class P>
inline constexpr auto kGainsOf = P::kGains;

/// All rows of a member of P, under a prefix.
template <class P, class Part, class Table>
struct GainPart {
  std::string_view prefix;
  Part P::*part;
  const Table* table;  ///< null: that of Part

  template <class Owner, class Visit>
  constexpr void visit(Owner& p, const std::string& prefix_of_owner, const Visit& see) const {
    const std::string all = prefix_of_owner + std::string(prefix);
    const auto each = [&](const auto&... row) { (row.visit(p.*part, all, see), ...); };
    if constexpr (std::is_same_v<Table, void>) {
      std::apply(each, kGainsOf<Part>);
    } else {
      std::apply(each, *table);
    }
  }
};

template <class P>
constexpr GainRow<P> gain(std::string_view name, double P::*number, GainRule rule = GainRule::kAny) {
  return {name, number, rule};
}

/// The member's own table.
template <class P, class Part>
constexpr GainPart<P, Part, void> gains_in(std::string_view prefix, Part P::*part) {
  return {prefix, part, nullptr};
}

/// Another table for the member: some of its numbers. The table must be static.
template <class P, class Part, class Table>
constexpr GainPart<P, Part, Table> gains_in(std::string_view prefix, Part P::*part, const Table& table) {
  return {prefix, part, &table};
}

/// see(name, number, rule) for every gain of p.
template <class P, class Visit>
void for_each_gain(P& p, const Visit& see) {
  std::apply([&](const auto&... row) { (row.visit(p, {}, see), ...); }, kGainsOf<std::remove_const_t<P>>);
}

/// The problem of this number as a sentence; empty: none.
std::string problem_with_gain(std::string_view name, double value, GainRule rule);

/// Every number of p that breaks the rule of its row, one sentence each. A parameter struct has
/// `std::vector<std::string> problems() const`, which starts from these and adds the rules between numbers;
/// every sentence begins with the name of a gain.
template <class P>
std::vector<std::string> range_problems(const P& p) {
  std::vector<std::string> found;
  for_each_gain(p, [&found](const std::string& name, double value, GainRule rule) {
    std::string problem = problem_with_gain(name, value, rule);
    if (!problem.empty()) found.push_back(std::move(problem));
  });
  return found;
}

/// The rows of the parts as they stand, one part after the other: names must differ between parts.
template <class... Parts>
std::vector<Gain> gains_of(const Parts&... parts) {
  std::vector<Gain> result;
  const auto append = [&result](const std::string& name, double value, GainRule) {
    result.push_back({name, value});
  };
  (for_each_gain(parts, append), ...);
  return result;
}

namespace gains_detail {

template <class P>
bool set_gain(P& p, const Gain& gain) {
  bool found = false;
  for_each_gain(p, [&](const std::string& name, double& value, GainRule) {
    if (name != gain.name) return;
    value = gain.value;
    found = true;
  });
  return found;
}

/// Throw std::invalid_argument.
[[noreturn]] void refuse_unknown(const Gain& gain, const std::vector<Gain>& known);
void refuse_problems(const std::vector<std::string>& problems, const std::vector<Gain>& values);

}  // namespace gains_detail

/// The parts with the overrides in place. Throws std::invalid_argument that names gain, value and rule, or
/// for an unknown name the nearest one or all.
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
