#include "clients/regression/suite/place_in_case.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clients/regression/suite/compose.hpp"
#include "clients/regression/tables/key_table.hpp"

namespace drivebench::regression {
namespace {

/// From the root to a node; an element of a list has its number.
using NodePath = std::vector<std::string>;

struct NodeOfLine {
  int line = 0;
  NodePath path{};
};

/// The deepest node of the last line up to this one. The nodes of a table come in the order of their names.
void find_place(const ConfigNode& node, int line, NodePath& here, NodeOfLine& best) {
  if (node.line <= line && node.line >= best.line) best = {node.line, here};
  for (std::size_t i = 0; i < node.children.size(); ++i) {
    const ConfigNode& child = node.children[i];
    here.push_back(node.kind == ConfigNode::Kind::kArray ? std::to_string(i) : child.key);
    find_place(child, line, here, best);
    here.pop_back();
  }
}

std::size_t place_in_list(std::string_view text) noexcept {
  std::size_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

std::string name_of(const ConfigNode& axis) {
  const ConfigNode* const name = find_child(axis, "name");
  const auto* const text = name != nullptr ? std::get_if<std::string>(&name->scalar) : nullptr;
  return text != nullptr ? *text : std::string();
}

/// The line of the step that became this event. The events of steps follow those of the bench file.
int line_of_step(const Case& c, const ConfigNode& axis, const NodePath& path) {
  const std::string& table = path[2];
  const ConfigNode* const events = find_child(axis, table);
  if (events == nullptr || path.size() < 4) return 0;
  std::vector<int> lines;
  for (const Step& step : c.steps) {
    if (step.action == Step::Action::kMessage || event_table(step.action) != table) continue;
    if (step.axis == path[1] || step.axis == name_of(axis)) lines.push_back(step.line);
  }
  const std::size_t of_bench = events->children.size() - std::min(events->children.size(), lines.size());
  const std::size_t event = place_in_list(path[3]);
  return event < of_bench || event - of_bench >= lines.size() ? 0 : lines[event - of_bench];
}

/// The line of the override at the path; 0: there is none.
int line_of_override(const ConfigNode& table, std::span<const std::string> path) {
  const ConfigNode* node = &table;
  for (const std::string& part : path) {
    const bool is_list = node->kind == ConfigNode::Kind::kArray;
    const std::size_t number = place_in_list(part);
    if (is_list && number >= node->children.size()) return 0;
    node = is_list ? &node->children[number] : find_child(*node, part);
    if (node == nullptr) return 0;
  }
  return path.empty() ? 0 : node->line;
}

}  // namespace

int line_in_case(const Case& c, std::string_view composed, int composed_line) {
  ProblemList none;
  const std::optional<ConfigNode> bench = parse_document(composed, "", none);
  if (!bench) return 0;
  NodeOfLine place;
  NodePath here;
  find_place(*bench, composed_line, here, place);
  const NodePath& path = place.path;
  if (path.size() < 2 || path[0] != "axis") return line_of_override(c.overrides, path);
  const ConfigNode& axis = find_child(*bench, "axis")->children[place_in_list(path[1])];
  const int step = path.size() > 2 ? line_of_step(c, axis, path) : 0;
  if (step != 0) return step;
  const ConfigNode* const axes = find_child(c.overrides, "axis");
  if (axes == nullptr) return 0;
  for (const std::string& choice : {path[1], name_of(axis)}) {
    const ConfigNode* const overrides = find_child(*axes, choice);
    if (overrides == nullptr) continue;
    if (const int line = line_of_override(*overrides, std::span(path).subspan(2)); line != 0) return line;
  }
  return 0;
}

}  // namespace drivebench::regression
