#include "clients/regression/shrink/shrink.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"

namespace drivebench::regression {
namespace {

/// The numbers of the children on the way from the root to a node.
using Place = std::vector<std::size_t>;

const ConfigNode& node_at(const ConfigNode& root, const Place& place) {
  const ConfigNode* node = &root;
  for (const std::size_t child : place)
    node = &node->children[child];
  return *node;
}

ConfigNode& node_at(ConfigNode& root, const Place& place) {
  return const_cast<ConfigNode&>(node_at(std::as_const(root), place));
}

/// The place of the node with this path of keys; nothing if there is none.
std::optional<Place> place_of(const ConfigNode& root, std::initializer_list<std::string_view> keys) {
  Place place;
  for (const std::string_view key : keys) {
    const ConfigNode& node = node_at(root, place);
    const auto found = std::ranges::find(node.children, key, &ConfigNode::key);
    if (found == node.children.end()) return std::nullopt;
    place.push_back(static_cast<std::size_t>(found - node.children.begin()));
  }
  return place;
}

/// Of every value that is no table, below a place.
void add_leaves(const ConfigNode& root, const Place& place, std::vector<Place>& leaves) {
  const ConfigNode& node = node_at(root, place);
  if (node.kind != ConfigNode::Kind::kTable) {
    leaves.push_back(place);
    return;
  }
  for (std::size_t i = 0; i < node.children.size(); ++i) {
    Place below = place;
    below.push_back(i);
    add_leaves(root, below, leaves);
  }
}

std::vector<Place> leaves_of(const ConfigNode& root, std::initializer_list<std::string_view> keys) {
  std::vector<Place> leaves;
  if (const std::optional<Place> place = place_of(root, keys)) add_leaves(root, *place, leaves);
  return leaves;
}

std::vector<Place> elements_of(const ConfigNode& root, std::string_view key) {
  std::vector<Place> elements;
  const std::optional<Place> place = place_of(root, {key});
  if (!place) return elements;
  for (std::size_t i = 0; i < node_at(root, *place).children.size(); ++i)
    elements.push_back({place->front(), i});
  return elements;
}

/// Keys that a case, or a step, need not have.
std::vector<Place> optional_keys(const ConfigNode& root) {
  static constexpr auto kOfTheCase = std::to_array<std::string_view>({"seed", "tags", "about"});
  static constexpr auto kOfAStep = std::to_array<std::string_view>({"ramp_s", "for_s", "delay_s"});
  std::vector<Place> places;
  for (const std::string_view key : kOfTheCase)
    if (const auto place = place_of(root, {key})) places.push_back(*place);
  for (const Place& step : elements_of(root, "step")) {
    const ConfigNode& table = node_at(root, step);
    for (std::size_t i = 0; i < table.children.size(); ++i) {
      if (std::ranges::find(kOfAStep, table.children[i].key) == kOfAStep.end()) continue;
      places.push_back({step[0], step[1], i});
    }
  }
  std::ranges::sort(places);
  return places;
}

/// Numbers that may become rounder: those of steps, overrides and gains.
std::vector<Place> numbers_of(const ConfigNode& root) {
  std::vector<Place> places;
  for (const Place& step : elements_of(root, "step"))
    add_leaves(root, step, places);
  for (const auto& more : {leaves_of(root, {"override"}), leaves_of(root, {"dut", "gains"})})
    places.insert(places.end(), more.begin(), more.end());
  std::erase_if(places, [&root](const Place& place) { return !number_in(node_at(root, place)); });
  return places;
}

/// Tables that have nothing in them any more say nothing.
void remove_empty(ConfigNode& node) {
  for (ConfigNode& child : node.children)
    remove_empty(child);
  std::erase_if(node.children, [](const ConfigNode& child) {
    return child.kind != ConfigNode::Kind::kScalar && child.children.empty();
  });
}

/// The table without the nodes at these places, which are in their order.
ConfigNode without(ConfigNode root, std::vector<Place>::const_iterator begin,
                   std::vector<Place>::const_iterator end) {
  while (end != begin) {
    Place place = *--end;
    const std::size_t last = place.back();
    place.pop_back();
    ConfigNode& parent = node_at(root, place);
    parent.children.erase(parent.children.begin() + static_cast<std::ptrdiff_t>(last));
  }
  remove_empty(root);
  return root;
}

/// Infinite for the largest numbers. std::stod would throw for the smallest ones.
double with_digits(double value, int digits) {
  return std::strtod(fmt::format("{:.{}e}", value, digits - 1).c_str(), nullptr);
}

ConfigNode scalar_of(const ConfigNode& like, double value) {
  ConfigNode node = like;
  if (std::holds_alternative<std::int64_t>(like.scalar)) {
    node.scalar = static_cast<std::int64_t>(std::llround(value));
  } else {
    node.scalar = value;
  }
  return node;
}

class Shrinker {
 public:
  Shrinker(ConfigNode table, const ShrinkPlan& plan, const StillFails& still_fails, const TellStep& tell)
      : table_(std::move(table)), plan_(plan), still_fails_(still_fails), tell_(tell) {}

  Shrunk run() {
    keep_only_the_check();
    std::string before;
    do {
      before = toml_text(table_);
      drop("steps", [](const ConfigNode& root) { return elements_of(root, "step"); });
      drop("overrides", [](const ConfigNode& root) { return leaves_of(root, {"override"}); });
      drop("gains", [](const ConfigNode& root) { return leaves_of(root, {"dut", "gains"}); });
      drop("optional keys", optional_keys);
      shorten();
      round_numbers();
    } while (has_runs() && toml_text(table_) != before);
    return {.table = table_, .runs = runs_, .is_smallest = has_runs()};
  }

 private:
  bool has_runs() const { return runs_ < plan_.most_runs && !plan_.is_stopped(); }

  /// Takes a table that fails as the first one did. None is tried twice.
  bool attempt(const ConfigNode& candidate) {
    if (!has_runs() || !tried_.insert(toml_text(candidate)).second) return false;
    ++runs_;
    if (!still_fails_(candidate)) return false;
    table_ = candidate;
    return true;
  }

  void keep_only_the_check() {
    std::vector<Place> checks = elements_of(table_, "check");
    tried_.insert(toml_text(table_));
    checks.erase(checks.begin() + static_cast<std::ptrdiff_t>(plan_.check));
    const std::size_t dropped = checks.size();
    if (attempt(without(table_, checks.begin(), checks.end())))
      tell_(fmt::format("{} other checks dropped", dropped), runs_);
  }

  /// Delta debugging: first all at once, then in halves, quarters and so on down to single ones.
  template <class ItemsOf>
  void drop(std::string_view what, ItemsOf items_of) {
    std::vector<Place> items = items_of(table_);
    const std::size_t all = items.size();
    for (std::size_t part = all; part > 0; part /= 2) {
      for (std::size_t at = 0; at < items.size();) {
        const std::size_t end = std::min(at + part, items.size());
        const auto from = items.cbegin();
        if (attempt(without(table_, from + static_cast<std::ptrdiff_t>(at),
                            from + static_cast<std::ptrdiff_t>(end)))) {
          items = items_of(table_);
        } else {
          at = end;
        }
      }
    }
    if (items.size() < all) tell_(fmt::format("{} of {} {} left", items.size(), all, what), runs_);
  }

  bool set_duration(double duration_s) {
    ConfigNode candidate = table_;
    std::erase_if(candidate.children, [](const ConfigNode& child) { return child.key == "duration_s"; });
    ConfigNode node{.key = "duration_s",
                    .line = 0,
                    .kind = ConfigNode::Kind::kScalar,
                    .scalar = duration_s,
                    .children = {}};
    candidate.children.insert(candidate.children.begin(), std::move(node));
    return attempt(candidate);
  }

  /// Halves the distance to the shortest run that fails, with two digits.
  void shorten() {
    if (!plan_.longest_s) return;
    const ConfigNode* const given = find_child(table_, "duration_s");
    double fails_s = given != nullptr ? number_in(*given).value_or(*plan_.longest_s) : *plan_.longest_s;
    const double before_s = fails_s;
    double passes_s = 0.0;
    while (has_runs()) {
      const double middle_s = with_digits(0.5 * (passes_s + fails_s), 2);
      if (middle_s <= passes_s || middle_s >= fails_s) break;
      (set_duration(middle_s) ? fails_s : passes_s) = middle_s;
    }
    if (fails_s < before_s) tell_(fmt::format("{:.6g} s of {:.6g} s left", fails_s, before_s), runs_);
  }

  void round_numbers() {
    std::size_t rounder = 0;
    for (const Place& place : numbers_of(table_)) {
      const double value = number_in(node_at(table_, place)).value_or(0.0);
      for (const double round : {0.0, with_digits(value, 1), with_digits(value, 2)}) {
        if (round == value) break;
        if (!std::isfinite(round)) continue;
        ConfigNode candidate = table_;
        ConfigNode& number = node_at(candidate, place);
        number = scalar_of(number, round);
        if (!attempt(candidate)) continue;
        ++rounder;
        break;
      }
    }
    if (rounder > 0) tell_(fmt::format("{} numbers are rounder", rounder), runs_);
  }

  ConfigNode table_;
  const ShrinkPlan& plan_;
  const StillFails& still_fails_;
  const TellStep& tell_;
  std::set<std::string> tried_{};
  std::size_t runs_ = 0;
};

}  // namespace

Shrunk shrink(const ConfigNode& table, const ShrinkPlan& plan, const StillFails& still_fails,
              const TellStep& tell) {
  return Shrinker(table, plan, still_fails, tell).run();
}

std::size_t leaf_count(const ConfigNode& node) {
  if (node.kind == ConfigNode::Kind::kScalar) return 1;
  std::size_t count = 0;
  for (const ConfigNode& child : node.children)
    count += leaf_count(child);
  return count;
}

}  // namespace drivebench::regression
