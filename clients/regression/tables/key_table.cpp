#include "clients/regression/tables/key_table.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {

const ConfigNode* find_child(const ConfigNode& table, std::string_view key) noexcept {
  const auto found = std::ranges::find(table.children, key, &ConfigNode::key);
  return found == table.children.end() ? nullptr : &*found;
}

std::optional<double> number_in(const ConfigNode& node) noexcept {
  if (node.kind != Kind::kScalar) return std::nullopt;
  if (const auto* integer = std::get_if<std::int64_t>(&node.scalar)) return static_cast<double>(*integer);
  const auto* real = std::get_if<double>(&node.scalar);
  return real != nullptr && std::isfinite(*real) ? std::optional(*real) : std::nullopt;
}

std::string described(const ConfigNode& node) {
  if (node.kind == Kind::kTable) return "a table";
  if (node.kind == Kind::kArray) return "an array";
  if (const auto* text = std::get_if<std::string>(&node.scalar)) return '"' + printable(*text) + '"';
  if (const auto* integer = std::get_if<std::int64_t>(&node.scalar)) return std::to_string(*integer);
  if (const auto* real = std::get_if<double>(&node.scalar)) return shortest(*real);
  if (const auto* other = std::get_if<ConfigNode::Other>(&node.scalar)) return std::string(other->what);
  if (const auto* flag = std::get_if<bool>(&node.scalar)) return *flag ? "true" : "false";
  return "a number that is not decimal";
}

KeyTable::KeyTable(const ConfigNode& node, std::string path, int line, const std::string& file,
                   ProblemList& problems)
    : node_(&node),
      path_(std::move(path)),
      line_(node.line > 0 ? node.line : line),
      file_(&file),
      problems_(&problems) {}

const ConfigNode* KeyTable::node(std::string_view key) {
  known_.emplace_back(key);
  return find_child(*node_, key);
}

std::optional<std::string> KeyTable::text(std::string_view key) {
  const ConfigNode* const found = node(key);
  if (found == nullptr) return std::nullopt;
  const auto* const value = found->kind == Kind::kScalar ? std::get_if<std::string>(&found->scalar) : nullptr;
  if (value != nullptr && !value->empty() && is_plain(*value)) return *value;
  report(key, "is " + described(*found) + " but must be text in quotes");
  return std::nullopt;
}

std::optional<double> KeyTable::number(std::string_view key, double minimum, double maximum) {
  const ConfigNode* const found = node(key);
  if (found == nullptr) return std::nullopt;
  const std::optional<double> value = number_in(*found);
  if (!value) {
    report(key, "is " + described(*found) + " but must be a finite number");
    return std::nullopt;
  }
  if (*value >= minimum && *value <= maximum) return value;
  report(key, "is " + shortest(*value) + " but must " +
                  (maximum == kAnyNumber ? "be at least " + shortest(minimum)
                                         : "lie between " + shortest(minimum) + " and " + shortest(maximum)));
  return std::nullopt;
}

std::optional<std::int64_t> KeyTable::integer(std::string_view key, std::int64_t minimum,
                                              std::int64_t maximum) {
  const ConfigNode* const found = node(key);
  if (found == nullptr) return std::nullopt;
  const auto* const value =
      found->kind == Kind::kScalar ? std::get_if<std::int64_t>(&found->scalar) : nullptr;
  if (value != nullptr && *value >= minimum && *value <= maximum) return *value;
  report(key, "is " + described(*found) + " but must be a whole number from " + std::to_string(minimum) +
                  " to " + std::to_string(maximum));
  return std::nullopt;
}

std::vector<std::string> KeyTable::texts(std::string_view key) {
  const ConfigNode* const found = node(key);
  if (found == nullptr) return {};
  std::vector<std::string> values;
  for (const ConfigNode& child : found->children) {
    const auto* const value = std::get_if<std::string>(&child.scalar);
    if (child.kind == Kind::kScalar && value != nullptr && is_plain(*value)) values.push_back(*value);
  }
  if (found->kind == Kind::kArray && !values.empty() && values.size() == found->children.size()) {
    return values;
  }
  report(key, "is " + described(*found) + " but must be a list of texts, [\"a\", \"b\"], at least one");
  return {};
}

std::optional<KeyTable> KeyTable::table(std::string_view key) {
  const ConfigNode* const found = node(key);
  if (found == nullptr) return std::nullopt;
  if (found->kind == Kind::kTable) return KeyTable(*found, path_of(key), line_, *file_, *problems_);
  report(key, "is " + described(*found) + " but must be a table, [" + path_of(key) + "]");
  return std::nullopt;
}

std::vector<KeyTable> KeyTable::tables(std::string_view key) {
  const ConfigNode* const found = node(key);
  if (found == nullptr) return {};
  std::vector<KeyTable> result;
  for (std::size_t i = 0; i < found->children.size(); ++i) {
    const ConfigNode& child = found->children[i];
    if (found->kind != Kind::kArray || child.kind != Kind::kTable) break;
    result.emplace_back(child, path_of(key) + "[" + std::to_string(i) + "]", line_of(key), *file_,
                        *problems_);
  }
  if (found->kind == Kind::kArray && result.size() == found->children.size()) return result;
  report(key, "is " + described(*found) + " but must be tables, [[" + path_of(key) + "]]");
  return {};
}

void KeyTable::require(std::string_view key) {
  if (!has(key)) problems_->add(*file_, line_, path_of(key), "is missing");
}

void KeyTable::finish() {
  for (const ConfigNode& child : node_->children) {
    if (std::ranges::find(known_, child.key) != known_.end()) continue;
    report(child.key, "is no key here" + advice(child.key, known_));
  }
}

void KeyTable::report(std::string_view key, std::string rule) {
  problems_->add(*file_, line_of(key), path_of(printable(key)), std::move(rule));
}

std::string KeyTable::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

int KeyTable::line_of(std::string_view key) const noexcept {
  const ConfigNode* const found = find_child(*node_, key);
  return found != nullptr && found->line > 0 ? found->line : line_;
}

}  // namespace drivebench::regression
