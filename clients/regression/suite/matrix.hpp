#pragma once

#include <string>
#include <utility>
#include <vector>

#include "protocols/document.hpp"

namespace drivebench::regression {

/// A key of the case that takes several values, one after the other.
struct MatrixAxis {
  std::vector<std::string> path;  ///< `step.0.load_nm`: tables by key, elements of arrays by number or name
  std::string label;              ///< the shortest end of the path that no other axis has
  std::vector<ConfigNode> values;
  int line = 0;
};

/// Every combination of values: all axes multiply, the last one fastest.
class Matrix {
 public:
  /// Reads `[matrix]` of a case; without one there is a single combination. Problems go to the list.
  Matrix(const ConfigNode& root, const std::string& file, ProblemList& problems);

  std::size_t size() const noexcept;
  /// The case file of a combination, as if the values stood in it.
  ConfigNode at(std::size_t combination, const ConfigNode& root, const std::string& file,
                ProblemList& problems) const;
  /// The values of a combination by their labels.
  std::vector<std::pair<std::string, std::string>> values_at(std::size_t combination) const;

 private:
  std::size_t index_of(std::size_t combination, std::size_t axis) const noexcept;

  std::vector<MatrixAxis> axes_;
};

}  // namespace drivebench::regression
