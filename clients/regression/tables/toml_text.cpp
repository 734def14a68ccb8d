#include "clients/regression/tables/toml_text.hpp"

#include <algorithm>
#include <cmath>

#include "clients/regression/tables/key_table.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

std::string basic_string_text(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

std::string key_text(const std::string& key) {
  const bool is_bare = !key.empty() && std::ranges::all_of(key, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
  return is_bare ? key : basic_string_text(key);
}

/// A real number keeps its point or exponent, so that it is read as a real one again.
std::string real_text(double value) {
  const std::string text = shortest(value);
  return std::isfinite(value) && text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

bool is_array_of_tables(const ConfigNode& node) {
  return node.kind == Kind::kArray && !node.children.empty() &&
         std::ranges::all_of(node.children,
                             [](const ConfigNode& child) { return child.kind == Kind::kTable; });
}

bool is_section(const ConfigNode& node) {
  return node.kind == Kind::kTable || is_array_of_tables(node);
}

/// `name` is that of the table, with a point at its end; empty for the root.
void append_table(std::string& text, const ConfigNode& table, const std::string& name) {
  for (const ConfigNode& child : table.children) {
    if (!is_section(child)) text += key_text(child.key) + " = " + toml_value(child) + '\n';
  }
  for (const ConfigNode& child : table.children) {
    if (!is_section(child)) continue;
    const std::string path = name + key_text(child.key);
    if (child.kind == Kind::kTable) {
      text += "\n[" + path + "]\n";
      append_table(text, child, path + ".");
      continue;
    }
    for (const ConfigNode& element : child.children) {
      text += "\n[[" + path + "]]\n";
      append_table(text, element, path + ".");
    }
  }
}

std::string inline_table(const ConfigNode& table) {
  std::string text;
  for (const ConfigNode& child : table.children)
    text += (text.empty() ? "" : ", ") + key_text(child.key) + " = " + toml_value(child);
  return "{" + text + "}";
}

std::string array_text(const ConfigNode& array) {
  constexpr std::size_t kLongestLine = 100;
  std::string text = "[";
  std::size_t line = 0;
  for (const ConfigNode& child : array.children) {
    const std::string value = toml_value(child);
    if (&child != &array.children.front()) text += ",";
    line += value.size() + 2;
    const bool is_full = line > kLongestLine;
    if (is_full) line = value.size();
    if (&child != &array.children.front()) text += is_full ? "\n" : " ";
    text += value;
  }
  return text + "]";
}

}  // namespace

std::string toml_value(const ConfigNode& value) {
  if (value.kind == Kind::kTable) return inline_table(value);
  if (value.kind == Kind::kArray) return array_text(value);
  if (const auto* text = std::get_if<std::string>(&value.scalar)) return basic_string_text(*text);
  if (const auto* integer = std::get_if<std::int64_t>(&value.scalar)) return std::to_string(*integer);
  if (const auto* real = std::get_if<double>(&value.scalar)) return real_text(*real);
  if (const auto* flag = std::get_if<bool>(&value.scalar)) return *flag ? "true" : "false";
  if (const auto* number = std::get_if<ConfigNode::Hexadecimal>(&value.scalar)) {
    return hexadecimal(number->value);
  }
  return basic_string_text(std::get<ConfigNode::Other>(value.scalar).what);
}

std::string toml_text(const ConfigNode& table) {
  std::string text;
  append_table(text, table, "");
  return text;
}

}  // namespace drivebench::regression
