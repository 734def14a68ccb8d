#include "clients/regression/suite/variation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "clients/regression/tables/key_table.hpp"
#include "clients/regression/tables/toml_text.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

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

}  // namespace

void append_key(std::vector<std::string>& path, const std::string& key) {
  for (std::size_t start = 0; start <= key.size();) {
    const std::size_t end = std::min(key.find('.', start), key.size());
    path.push_back(key.substr(start, end - start));
    start = end + 1;
  }
}

std::string joined(std::span<const std::string> path) {
  return fmt::format("{}", fmt::join(path, "."));
}

void give_labels(std::span<Variation* const> variations) {
  for (Variation* const each : variations) {
    const std::vector<std::string>& path = each->path;
    const auto has_same_end = [&path, each, variations](std::size_t parts) {
      return std::ranges::any_of(variations, [&](const Variation* other) {
        const auto same = static_cast<std::ptrdiff_t>(parts);
        return other != each && other->path.size() >= parts &&
               std::equal(path.end() - same, path.end(), other->path.end() - same);
      });
    };
    std::size_t parts = 1;
    while (parts < path.size() && has_same_end(parts))
      ++parts;
    each->label = joined(std::span(path).last(parts));
  }
}

bool put(ConfigNode& root, const Variation& variation, std::size_t index) {
  ConfigNode* const place = place_at(root, variation.path, variation.line);
  if (place == nullptr) return false;
  const std::string key = place->key;
  *place = variation.values[index];
  place->key = key;
  place->line = variation.line;
  return true;
}

std::string text_of(const ConfigNode& value) {
  const auto* const text = std::get_if<std::string>(&value.scalar);
  return value.kind == Kind::kScalar && text != nullptr ? printable(*text) : toml_value(value);
}

ConfigNode number_node(double value, bool is_whole, int line) {
  ConfigNode node{.key = {}, .line = line, .kind = Kind::kScalar, .scalar = {}, .children = {}};
  if (is_whole) {
    node.scalar = static_cast<std::int64_t>(value);
  } else {
    node.scalar = value;
  }
  return node;
}

}  // namespace drivebench::regression
