#include "clients/regression/suite/matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr std::size_t kMostCombinations = 1'000'000;

ConfigNode number_node(double value, bool is_whole, int line) {
  ConfigNode node{.key = {}, .line = line, .kind = Kind::kScalar, .scalar = {}, .children = {}};
  if (is_whole) {
    node.scalar = static_cast<std::int64_t>(value);
  } else {
    node.scalar = value;
  }
  return node;
}

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
      if (child.kind == Kind::kArray) {
        add({.path = here, .label = {}, .values = child.children, .line = child.line});
      } else if (child.kind == Kind::kTable && find_child(child, "from") != nullptr) {
        KeyTable range(child, "matrix." + joined(here), child.line, file_, problems_);
        add({.path = here, .label = {}, .values = range_values(range, child), .line = child.line});
      } else if (child.kind == Kind::kTable) {
        read(child, here);
      } else {
        problems_.add(
            file_, child.line, "matrix." + joined(here),
            "is " + described(child) + " but must be a list, [1, 2], or a range, {from = 1, to = 9}");
      }
    }
  }

  /// In the order of the file; the parser gives them by name.
  std::vector<MatrixAxis> axes() {
    std::ranges::stable_sort(axes_, {}, &MatrixAxis::line);
    for (MatrixAxis& axis : axes_)
      axis.label = label_of(axis);
    return std::move(axes_);
  }

  static std::string joined(std::span<const std::string> path) {
    return fmt::format("{}", fmt::join(path, "."));
  }

 private:
  /// A quoted key may spell several parts: "step.0.load_nm".
  static void append_key(std::vector<std::string>& path, const std::string& key) {
    for (std::size_t start = 0; start <= key.size();) {
      const std::size_t end = std::min(key.find('.', start), key.size());
      path.push_back(key.substr(start, end - start));
      start = end + 1;
    }
  }

  void add(MatrixAxis axis) {
    if (axis.values.empty()) problems_.add(file_, axis.line, "matrix." + joined(axis.path), "has no values");
    axes_.push_back(std::move(axis));
  }

  std::string label_of(const MatrixAxis& axis) const {
    for (std::size_t parts = 1; parts < axis.path.size(); ++parts) {
      const auto has_same_end = [&](const MatrixAxis& other) {
        return &other != &axis && other.path.size() >= parts &&
               std::equal(axis.path.end() - static_cast<std::ptrdiff_t>(parts), axis.path.end(),
                          other.path.end() - static_cast<std::ptrdiff_t>(parts));
      };
      if (std::ranges::none_of(axes_, has_same_end)) return joined(std::span(axis.path).last(parts));
    }
    return joined(axis.path);
  }

  const std::string& file_;
  ProblemList& problems_;
  std::vector<MatrixAxis> axes_;
};

std::optional<std::size_t> index_in(const ConfigNode& array, const std::string& part) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (error == std::errc{} && end == part.data() + part.size()) {
    return index < array.children.size() ? std::optional(index) : std::nullopt;
  }
  for (index = 0; index < array.children.size(); ++index) {
    const ConfigNode* const name = find_child(array.children[index], "name");
    const auto* const text = name != nullptr ? std::get_if<std::string>(&name->scalar) : nullptr;
    if (text != nullptr && *text == part) return index;
  }
  return std::nullopt;
}

/// The place of the path below the table, made where a table lacks it; null: an array has no such element.
ConfigNode* place_at(ConfigNode& root, std::span<const std::string> path, int line) {
  ConfigNode* node = &root;
  for (const std::string& part : path) {
    if (node->kind == Kind::kArray) {
      const std::optional<std::size_t> index = index_in(*node, part);
      if (!index) return nullptr;
      node = &node->children[*index];
      continue;
    }
    if (node->kind != Kind::kTable) return nullptr;
    const auto found = std::ranges::find(node->children, part, &ConfigNode::key);
    if (found != node->children.end()) {
      node = &*found;
    } else {
      node->children.push_back(
          {.key = part, .line = line, .kind = Kind::kTable, .scalar = {}, .children = {}});
      node = &node->children.back();
    }
  }
  return node;
}

std::string text_of(const ConfigNode& value) {
  const auto* const text = std::get_if<std::string>(&value.scalar);
  return value.kind == Kind::kScalar && text != nullptr ? printable(*text) : toml_value(value);
}

}  // namespace

Matrix::Matrix(const ConfigNode& root, const std::string& file, ProblemList& problems) {
  const ConfigNode* const matrix = find_child(root, "matrix");
  if (matrix == nullptr) return;
  if (matrix->kind != Kind::kTable) {
    problems.add(file, matrix->line, "matrix", "is " + described(*matrix) + " but must be a table, [matrix]");
    return;
  }
  MatrixReader reader(file, problems);
  reader.read(*matrix, {});
  axes_ = reader.axes();
  double combinations = 1.0;
  for (const MatrixAxis& axis : axes_)
    combinations *= static_cast<double>(axis.values.size());
  if (combinations <= static_cast<double>(kMostCombinations)) return;
  problems.add(file, matrix->line, "matrix",
               fmt::format("has {:.0f} combinations but may have {}", combinations, kMostCombinations));
  axes_.clear();
}

std::size_t Matrix::size() const noexcept {
  std::size_t combinations = 1;
  for (const MatrixAxis& axis : axes_)
    combinations *= axis.values.size();
  return combinations;
}

std::size_t Matrix::index_of(std::size_t combination, std::size_t axis) const noexcept {
  for (std::size_t later = axes_.size() - 1; later > axis; --later)
    combination /= axes_[later].values.size();
  return combination % axes_[axis].values.size();
}

ConfigNode Matrix::at(std::size_t combination, const ConfigNode& root, const std::string& file,
                      ProblemList& problems) const {
  ConfigNode result = root;
  std::erase_if(result.children, [](const ConfigNode& child) { return child.key == "matrix"; });
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const MatrixAxis& axis = axes_[i];
    ConfigNode* const place = place_at(result, axis.path, axis.line);
    if (place == nullptr) {
      problems.add(file, axis.line, "matrix." + MatrixReader::joined(axis.path),
                   "names no place in this case");
      continue;
    }
    const std::string key = place->key;
    *place = axis.values[index_of(combination, i)];
    place->key = key;
    place->line = axis.line;
  }
  return result;
}

std::vector<std::pair<std::string, std::string>> Matrix::values_at(std::size_t combination) const {
  std::vector<std::pair<std::string, std::string>> values;
  for (std::size_t i = 0; i < axes_.size(); ++i)
    values.emplace_back(axes_[i].label, text_of(axes_[i].values[index_of(combination, i)]));
  return values;
}

}  // namespace drivebench::regression
