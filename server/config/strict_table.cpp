#include "server/config/strict_table.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocols/nearest_name.hpp"
#include "protocols/text.hpp"
#include "server/config/config.hpp"

namespace drivebench {
namespace {

using Kind = ConfigNode::Kind;

/// Describes the node, for "is ... but must be ...".
std::string described(const ConfigNode& node) {
  if (node.kind == Kind::kTable) return "a table";
  if (node.kind == Kind::kArray) return "an array";
  if (const auto* other = std::get_if<ConfigNode::Other>(&node.scalar)) return std::string(other->what);
  if (const auto* text = std::get_if<std::string>(&node.scalar)) return '"' + printable(*text) + '"';
  if (const auto* integer = std::get_if<std::int64_t>(&node.scalar)) return std::to_string(*integer);
  if (const auto* real = std::get_if<double>(&node.scalar)) return shortest(*real);
  if (std::holds_alternative<ConfigNode::Hexadecimal>(node.scalar)) return "a number that is not decimal";
  return std::get<bool>(node.scalar) ? "true" : "false";
}

std::string quoted(std::span<const std::string_view> words) {
  std::string list;
  for (const std::string_view word : words)
    list.append(list.empty() ? "\"" : ", \"").append(word).append("\"");
  return list;
}

bool belongs_to_identifier(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
         c == '-';
}

std::string outside(const std::string& value, const std::string& minimum, const std::string& maximum) {
  return "is " + value + " but must lie between " + minimum + " and " + maximum;
}

}  // namespace

StrictTable::StrictTable(const ConfigNode* table, std::string path, int line, const std::string& file,
                         ProblemList& problems)
    : table_(table), path_(std::move(path)), line_(line), file_(&file), problems_(&problems) {}

std::optional<bool> StrictTable::boolean(std::string_view key) {
  const bool* value = scalar<bool>(key, "true or false");
  return value != nullptr ? std::optional(*value) : std::nullopt;
}

std::optional<std::int64_t> StrictTable::integer(std::string_view key, std::int64_t minimum,
                                                 std::int64_t maximum) {
  const std::int64_t* value = scalar<std::int64_t>(key, "a whole number");
  if (value == nullptr) return std::nullopt;
  if (*value >= minimum && *value <= maximum) return *value;
  report(key, outside(std::to_string(*value), std::to_string(minimum), std::to_string(maximum)));
  return std::nullopt;
}

std::optional<std::int64_t> StrictTable::hexadecimal_integer(std::string_view key, std::int64_t minimum,
                                                             std::int64_t maximum) {
  const ConfigNode* node = find(key);
  const auto* value = node != nullptr ? std::get_if<ConfigNode::Hexadecimal>(&node->scalar) : nullptr;
  if (value == nullptr) return integer(key, minimum, maximum);
  take(key);
  if (value->value >= minimum && value->value <= maximum) return value->value;
  report(key, outside(hexadecimal(value->value), hexadecimal(minimum), hexadecimal(maximum)));
  return std::nullopt;
}

std::optional<double> StrictTable::real(std::string_view key) {
  const ConfigNode* node = take(key);
  if (node == nullptr) return std::nullopt;
  if (node->kind == Kind::kScalar) {
    if (const auto* integer = std::get_if<std::int64_t>(&node->scalar)) return static_cast<double>(*integer);
    if (const auto* value = std::get_if<double>(&node->scalar); value != nullptr && std::isfinite(*value)) {
      return *value;
    }
  }
  report(key, "is " + described(*node) + " but must be a finite number");
  return std::nullopt;
}

std::optional<double> StrictTable::real(std::string_view key, double minimum, double maximum) {
  const std::optional<double> value = real(key);
  if (!value || (*value >= minimum && *value <= maximum)) return value;
  report(key, outside(shortest(*value), shortest(minimum), shortest(maximum)));
  return std::nullopt;
}

std::optional<std::string> StrictTable::text(std::string_view key, std::size_t most) {
  const std::string* value = scalar<std::string>(key, "text in quotes");
  if (value == nullptr) return std::nullopt;
  if (!value->empty() && value->size() <= most && is_plain(*value)) return *value;
  report(key, "is \"" + printable(*value) + "\" but must be text of 1 to " + std::to_string(most) +
                  " bytes without control characters or changes of direction");
  return std::nullopt;
}

std::optional<std::string> StrictTable::identifier(std::string_view key) {
  std::optional<std::string> value = text(key, 64);
  if (!value || std::all_of(value->begin(), value->end(), belongs_to_identifier)) return value;
  report(key, "is \"" + printable(*value) + "\" but may hold only letters, digits, '.', '_' and '-'");
  return std::nullopt;
}

std::optional<std::string> StrictTable::address(std::string_view key) {
  std::optional<std::string> value = text(key, 64);
  if (!value || is_address(*value)) return value;
  report(key, "is \"" + printable(*value) + "\" but must be an IPv4 or IPv6 address or \"localhost\"");
  return std::nullopt;
}

std::optional<std::size_t> StrictTable::choice(std::string_view key,
                                               std::span<const std::string_view> words) {
  const std::string* value = scalar<std::string>(key, "one of " + quoted(words));
  if (value == nullptr) return std::nullopt;
  const auto found = std::find(words.begin(), words.end(), *value);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  report(key, "is \"" + printable(*value) + "\" but must be one of " + quoted(words));
  return std::nullopt;
}

StrictTable StrictTable::table(std::string_view key) {
  const ConfigNode* node = take(key);
  if (node != nullptr && node->kind != Kind::kTable) {
    report(key, "is " + described(*node) + " but must be a table: [" + path_of(key) + "]");
    node = nullptr;
  }
  return {node, path_of(key), line_of(key), *file_, *problems_};
}

std::vector<StrictTable> StrictTable::tables(std::string_view key, std::size_t most) {
  const ConfigNode* node = take(key);
  std::vector<StrictTable> result;
  if (node == nullptr) return result;
  const bool all_tables = node->kind == Kind::kArray &&
                          std::all_of(node->children.begin(), node->children.end(),
                                      [](const ConfigNode& child) { return child.kind == Kind::kTable; });
  if (!all_tables) {
    report(key,
           "is " + described(*node) + " but must be a list of tables, each headed [[" + path_of(key) + "]]");
    return result;
  }
  if (node->children.empty()) {
    report(key, "is empty; leave it out or give it a table, headed [[" + path_of(key) + "]]");
    return result;
  }
  if (node->children.size() > most) {
    report(key, "occurs " + std::to_string(node->children.size()) + " times but may occur at most " +
                    std::to_string(most) + " times");
    return result;
  }
  for (const ConfigNode& child : node->children)
    result.push_back({&child, path_of(key), child.line, *file_, *problems_});
  return result;
}

void StrictTable::require(std::string_view key) {
  if (!has(key)) report(key, "is missing");
}

void StrictTable::finish() {
  if (table_ == nullptr) return;
  for (const ConfigNode& child : table_->children) {
    if (std::find(known_.begin(), known_.end(), child.key) != known_.end()) continue;
    problems_->add(*file_, child.line, printable(path_of(child.key)),
                   "is not a known key" + (problems_->full() ? "" : advice(child.key, known_)));
  }
}

int StrictTable::line_of(std::string_view key) const {
  const ConfigNode* node = find(key);
  return node != nullptr ? node->line : line_;
}

void StrictTable::report_at(int line, std::string_view key, std::string rule) {
  problems_->add(*file_, line, printable(path_of(key)), std::move(rule));
}

const ConfigNode* StrictTable::find(std::string_view key) const {
  if (table_ == nullptr) return nullptr;
  const auto found = std::find_if(table_->children.begin(), table_->children.end(),
                                  [&](const ConfigNode& child) { return child.key == key; });
  return found != table_->children.end() ? &*found : nullptr;
}

const ConfigNode* StrictTable::take(std::string_view key) {
  if (std::ranges::find(known_, key) == known_.end()) known_.emplace_back(key);
  return find(key);
}

template <class T>
const T* StrictTable::scalar(std::string_view key, std::string_view expected) {
  const ConfigNode* node = take(key);
  if (node == nullptr) return nullptr;
  if (node->kind == Kind::kScalar) {
    if (const T* value = std::get_if<T>(&node->scalar)) return value;
  }
  report(key, "is " + described(*node) + " but must be " + std::string(expected));
  return nullptr;
}

std::string StrictTable::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

}  // namespace drivebench
