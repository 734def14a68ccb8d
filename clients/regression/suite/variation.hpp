#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "protocols/document.hpp"

namespace drivebench::regression {

/// A key of the case that takes several values, one after the other.
struct Variation {
  std::vector<std::string> path;  ///< `step.0.load_nm`: tables by key, elements of arrays by number or name
  std::string key;                ///< as problems name it: `matrix.step.0.load_nm`
  std::string label{};            ///< the shortest end of the path that no other variation has
  std::vector<ConfigNode> values;
  int line = 0;
};

/// Adds a key to a path. A quoted key may spell several parts: "step.0.load_nm".
void append_key(std::vector<std::string>& path, const std::string& key);

/// The path as one text.
std::string joined(std::span<const std::string> path);

/// Gives each variation its label.
void give_labels(std::span<Variation* const> variations);

/// Writes a value into the case file, making tables that it lacks. False: an array has no such element.
bool put(ConfigNode& root, const Variation& variation, std::size_t index);

/// The value as the names of cases have it.
std::string text_of(const ConfigNode& value);

ConfigNode number_node(double value, bool is_whole, int line);

}  // namespace drivebench::regression
