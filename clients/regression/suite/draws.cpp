#include "clients/regression/suite/draws.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "clients/regression/tables/key_table.hpp"
#include "plant/math/exponential.hpp"
#include "plant/math/trig.hpp"

namespace drivebench::regression {
namespace {

/// A bounded normal value that is outside its bounds so often has none within them.
constexpr int kMostTrials = 10'000;

/// The standard fixes the engine and its seeding, but no distribution.
class Stream {
 public:
  Stream(std::int64_t seed, const std::string& path, std::size_t draw) : engine_(seeded(seed, path, draw)) {}

  /// At least 0 and below 1.
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  double normal() {
    const double radius = std::sqrt(-2.0 * logarithm(1.0 - unit()));
    return radius * cosine(2.0 * std::numbers::pi * unit());
  }

 private:
  static std::mt19937_64 seeded(std::int64_t seed, const std::string& path, std::size_t draw) {
    std::vector<std::uint32_t> words;
    for (const auto number : {static_cast<std::uint64_t>(seed), static_cast<std::uint64_t>(draw)}) {
      words.push_back(static_cast<std::uint32_t>(number));
      words.push_back(static_cast<std::uint32_t>(number >> 32));
    }
    words.insert(words.end(), path.begin(), path.end());
    std::seed_seq sequence(words.begin(), words.end());
    return std::mt19937_64(sequence);
  }

  std::mt19937_64 engine_;
};

double six_digits(double value) {
  const std::string text = fmt::format("{:.6g}", value);
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// How the value of one key is drawn.
struct Distribution {
  enum class Kind { kUniform, kLogUniform, kNormal, kInteger, kOneOf };
  Kind kind = Kind::kUniform;
  double a = 0.0;
  double b = 1.0;
  double min = -kAnyNumber;
  double max = kAnyNumber;
  std::vector<ConfigNode> choices{};

  /// Nothing: no value came within the bounds.
  std::optional<ConfigNode> draw(Stream& stream, int line) const {
    switch (kind) {
      case Kind::kUniform:
        return number_node(six_digits(a + (b - a) * stream.unit()), false, line);
      case Kind::kLogUniform:
        return number_node(six_digits(a * exponential(logarithm(b / a) * stream.unit())), false, line);
      case Kind::kInteger:
        return number_node(a + std::floor((b - a + 1.0) * stream.unit()), true, line);
      case Kind::kOneOf:
        return choices[static_cast<std::size_t>(static_cast<double>(choices.size()) * stream.unit())];
      case Kind::kNormal:
        break;
    }
    for (int trial = 0; trial < kMostTrials; ++trial) {
      const double value = six_digits(a + b * stream.normal());
      if (value >= min && value <= max) return number_node(value, false, line);
    }
    return std::nullopt;
  }
};

struct KindName {
  const char* name;
  Distribution::Kind kind;
};
constexpr auto kKinds = std::to_array<KindName>({{"uniform", Distribution::Kind::kUniform},
                                                 {"log_uniform", Distribution::Kind::kLogUniform},
                                                 {"normal", Distribution::Kind::kNormal},
                                                 {"integer", Distribution::Kind::kInteger},
                                                 {"one_of", Distribution::Kind::kOneOf}});

const KindName* kind_in(const ConfigNode& table) {
  for (const KindName& each : kKinds) {
    if (find_child(table, each.name) != nullptr) return &each;
  }
  return nullptr;
}

/// The rule that the two numbers break; null: none.
const char* broken_rule(Distribution::Kind kind, const std::vector<double>& numbers) {
  if (numbers.size() != 2) return "must be two finite numbers";
  const double a = numbers[0];
  const double b = numbers[1];
  switch (kind) {
    case Distribution::Kind::kNormal:
      return b > 0.0 ? nullptr : "must be a mean and a standard deviation above 0";
    case Distribution::Kind::kLogUniform:
      return a > 0.0 && b > a ? nullptr : "must be two rising numbers above 0";
    case Distribution::Kind::kInteger:
      if (a != std::floor(a) || b != std::floor(b) || std::abs(a) > 0x1p52 || std::abs(b) > 0x1p52)
        return "must be two whole numbers of at most 2^52";
      return b > a ? nullptr : "must be two rising numbers";
    case Distribution::Kind::kUniform:
    case Distribution::Kind::kOneOf:
      break;
  }
  return b > a ? nullptr : "must be two rising numbers";
}

/// Nothing: the table has a problem, which has been told.
std::optional<Distribution> read_distribution(KeyTable& table, const KindName& kind) {
  Distribution distribution{.kind = kind.kind};
  const ConfigNode& list = *table.node(kind.name);
  std::vector<double> numbers;
  for (const ConfigNode& each : list.children) {
    if (const auto number = number_in(each)) numbers.push_back(*number);
  }
  const bool is_normal = kind.kind == Distribution::Kind::kNormal;
  if (is_normal) {
    distribution.min = table.number("min").value_or(distribution.min);
    distribution.max = table.number("max").value_or(distribution.max);
  }
  table.finish();
  const char* rule = nullptr;
  if (list.kind != Kind::kArray || list.children.empty()) {
    rule = "must be a list";
  } else if (kind.kind == Distribution::Kind::kOneOf) {
    distribution.choices = list.children;
  } else if (numbers.size() != list.children.size()) {
    rule = "must be two finite numbers";
  } else {
    rule = broken_rule(kind.kind, numbers);
  }
  if (rule == nullptr && distribution.min > distribution.max) rule = "has a max below its min";
  if (rule != nullptr) {
    table.report(kind.name, rule);
    return std::nullopt;
  }
  if (numbers.size() == 2) {
    distribution.a = numbers[0];
    distribution.b = numbers[1];
  }
  return distribution;
}

/// Collects the distributions below `[draw.of]`, whose tables spell the path.
class DrawReader {
 public:
  DrawReader(std::int64_t seed, std::size_t count, const std::string& file, ProblemList& problems)
      : seed_(seed), file_(file), problems_(problems) {
    draws_.count = count;
  }

  void read(const ConfigNode& table, const std::vector<std::string>& path) {
    for (const ConfigNode& child : table.children) {
      std::vector<std::string> here = path;
      append_key(here, child.key);
      const KindName* const kind = child.kind == Kind::kTable ? kind_in(child) : nullptr;
      if (kind != nullptr) {
        KeyTable inner(child, "draw.of." + joined(here), child.line, file_, problems_);
        if (const auto distribution = read_distribution(inner, *kind)) add(*distribution, here, child.line);
      } else if (child.kind == Kind::kTable) {
        read(child, here);
      } else {
        problems_.add(file_, child.line, "draw.of." + joined(here),
                      "is " + described(child) +
                          " but must be a distribution: {uniform = [0, 1]}, or log_uniform, normal, "
                          "integer, one_of");
      }
    }
  }

  Draws draws() {
    std::ranges::stable_sort(draws_.variations, {}, &Variation::line);
    return std::move(draws_);
  }

 private:
  void add(const Distribution& distribution, const std::vector<std::string>& path, int line) {
    const std::string name = joined(path);
    Variation variation{.path = path, .key = "draw.of." + name, .values = {}, .line = line};
    for (std::size_t draw = 0; draw < draws_.count; ++draw) {
      Stream stream(seed_, name, draw);
      const std::optional<ConfigNode> value = distribution.draw(stream, line);
      if (!value) {
        problems_.add(file_, line, variation.key, "has next to no values between its min and its max");
        return;
      }
      variation.values.push_back(*value);
    }
    draws_.variations.push_back(std::move(variation));
  }

  std::int64_t seed_;
  const std::string& file_;
  ProblemList& problems_;
  Draws draws_;
};

}  // namespace

Draws read_draws(const ConfigNode& root, const std::string& file, ProblemList& problems) {
  const ConfigNode* const node = find_child(root, "draw");
  if (node == nullptr) return {};
  if (node->kind != Kind::kTable) {
    problems.add(file, node->line, "draw", "is " + described(*node) + " but must be a table, [draw]");
    return {};
  }
  KeyTable table(*node, "draw", node->line, file, problems);
  table.require("count");
  table.require("of");
  const auto count = table.integer("count", 1, static_cast<std::int64_t>(kMostCombinations));
  const auto seed = table.integer("seed", 0, kMostSeed);
  const bool is_whole = table.table("of").has_value();
  const ConfigNode* const of = table.node("of");
  table.finish();
  if (!count || !is_whole) return {};
  DrawReader reader(seed.value_or(0), static_cast<std::size_t>(*count), file, problems);
  reader.read(*of, {});
  return reader.draws();
}

}  // namespace drivebench::regression
