#include "clients/regression/suite/matrix.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "clients/regression/tables/key_table.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

bool is_whole(const ConfigNode* node) {
  return node == nullptr || std::holds_alternative<std::int64_t>(node->scalar);
}

/// `{from, to, step}` or `{from, to, count}`, both ends included; whole numbers stay whole.
std::vector<ConfigNode> range_values(KeyTable& range, const ConfigNode& node) {
  range.require("from");
  range.require("to");
  const auto from = range.number("from");
  const auto to = range.number("to");
  const auto step = range.number("step", 1e-300);
  const auto count = range.integer("count", 1, static_cast<std::int64_t>(kMostCombinations));
  range.finish();
  if (!from || !to) return {};
  if (*to < *from) {
    range.report("to", "is " + shortest(*to) + " but must not lie below from, " + shortest(*from));
    return {};
  }
  if (step && count) {
    range.report("count", "cannot stand beside step");
    return {};
  }
  const double steps = count ? static_cast<double>(*count - 1) : (*to - *from) / step.value_or(1.0);
  if (!(steps < static_cast<double>(kMostCombinations))) {
    range.report("to", fmt::format("makes more than {} values", kMostCombinations));
    return {};
  }
  const bool whole = !count && is_whole(find_child(node, "from")) && is_whole(find_child(node, "to")) &&
                     is_whole(find_child(node, "step"));
  std::vector<ConfigNode> values;
  const auto last = static_cast<std::int64_t>(std::floor(steps + 1e-9));
  for (std::int64_t i = 0; i <= last; ++i) {
    const double part = static_cast<double>(i);
    const double value = count ? *from + (steps > 0.0 ? (*to - *from) * (part / steps) : 0.0)
                               : *from + part * step.value_or(1.0);
    values.push_back(number_node(value, whole, node.line));
  }
  return values;
}

/// Collects the lists and ranges of `[matrix]`, whose tables spell the path.
class MatrixReader {
 public:
  MatrixReader(const std::string& file, ProblemList& problems) : file_(file), problems_(problems) {}

  void read(const ConfigNode& table, const std::vector<std::string>& path) {
    for (const ConfigNode& child : table.children) {
      std::vector<std::string> here = path;
      append_key(here, child.key);
      const std::string key = "matrix." + joined(here);
      if (child.kind == Kind::kArray) {
        add({.path = here, .key = key, .values = child.children, .line = child.line});
      } else if (child.kind == Kind::kTable && find_child(child, "from") != nullptr) {
        KeyTable range(child, key, child.line, file_, problems_);
        add({.path = here, .key = key, .values = range_values(range, child), .line = child.line});
      } else if (child.kind == Kind::kTable) {
        read(child, here);
      } else {
        problems_.add(
            file_, child.line, key,
            "is " + described(child) + " but must be a list, [1, 2], or a range, {from = 1, to = 9}");
      }
    }
  }

  /// In the order of the file; the parser gives them by name.
  std::vector<Variation> axes() {
    std::ranges::stable_sort(axes_, {}, &Variation::line);
    return std::move(axes_);
  }

 private:
  void add(Variation axis) {
    if (axis.values.empty()) problems_.add(file_, axis.line, axis.key, "has no values");
    axes_.push_back(std::move(axis));
  }

  const std::string& file_;
  ProblemList& problems_;
  std::vector<Variation> axes_;
};

}  // namespace

Matrix::Matrix(const ConfigNode& root, const std::string& file, ProblemList& problems)
    : draws_(read_draws(root, file, problems)) {
  if (const ConfigNode* const matrix = find_child(root, "matrix"); matrix != nullptr) {
    if (matrix->kind == Kind::kTable) {
      MatrixReader reader(file, problems);
      reader.read(*matrix, {});
      axes_ = reader.axes();
    } else {
      problems.add(file, matrix->line, "matrix",
                   "is " + described(*matrix) + " but must be a table, [matrix]");
    }
  }
  double combinations = static_cast<double>(draws_.count);
  for (const Variation& axis : axes_)
    combinations *= static_cast<double>(axis.values.size());
  if (combinations > static_cast<double>(kMostCombinations)) {
    problems.add(file, axes_.front().line, "matrix",
                 fmt::format("has, with the draws, {:.0f} combinations but may have {}", combinations,
                             kMostCombinations));
    axes_.clear();
  }
  label();
}

void Matrix::label() {
  std::vector<Variation*> all;
  for (Variation& each : axes_)
    all.push_back(&each);
  for (Variation& each : draws_.variations)
    all.push_back(&each);
  give_labels(all);
}

std::size_t Matrix::size() const noexcept {
  std::size_t combinations = draws_.count;
  for (const Variation& axis : axes_)
    combinations *= axis.values.size();
  return combinations;
}

std::vector<Matrix::Choice> Matrix::choices_at(std::size_t combination) const {
  std::vector<Choice> choices;
  for (const Variation& each : draws_.variations)
    choices.push_back({&each, combination % draws_.count});
  std::size_t rest = combination / draws_.count;
  for (auto axis = axes_.rbegin(); axis != axes_.rend(); ++axis) {
    choices.insert(choices.begin(), {&*axis, rest % axis->values.size()});
    rest /= axis->values.size();
  }
  return choices;
}

ConfigNode Matrix::at(std::size_t combination, const ConfigNode& root, const std::string& file,
                      ProblemList& problems) const {
  ConfigNode result = root;
  std::erase_if(result.children,
                [](const ConfigNode& child) { return child.key == "matrix" || child.key == "draw"; });
  for (const auto& [variation, index] : choices_at(combination)) {
    if (put(result, *variation, index)) continue;
    problems.add(file, variation->line, variation->key, "names no place in this case");
  }
  return result;
}

std::vector<std::pair<std::string, std::string>> Matrix::values_at(std::size_t combination) const {
  std::vector<std::pair<std::string, std::string>> values;
  for (const auto& [variation, index] : choices_at(combination))
    values.emplace_back(variation->label, text_of(variation->values[index]));
  if (draws_.count > 1) {
    const auto first_drawn = values.begin() + static_cast<std::ptrdiff_t>(axes_.size());
    values.insert(first_drawn, {"draw", std::to_string(combination % draws_.count)});
  }
  return values;
}

}  // namespace drivebench::regression
