#pragma once

#include <string>
#include <utility>
#include <vector>

#include "clients/regression/suite/draws.hpp"

namespace drivebench::regression {

/// Every combination of values: the lists of `[matrix]` multiply with each other and with the draws of
/// `[draw]`, the last list faster than those before it, the draws fastest.
class Matrix {
 public:
  /// Without the two tables there is a single combination. Problems go to the list.
  Matrix(const ConfigNode& root, const std::string& file, ProblemList& problems);

  std::size_t size() const noexcept;
  /// The case file of a combination, as if the values stood in it.
  ConfigNode at(std::size_t combination, const ConfigNode& root, const std::string& file,
                ProblemList& problems) const;
  /// The values of a combination by their labels.
  std::vector<std::pair<std::string, std::string>> values_at(std::size_t combination) const;

 private:
  struct Choice {
    const Variation* variation;
    std::size_t index;
  };
  std::vector<Choice> choices_at(std::size_t combination) const;
  void label();

  std::vector<Variation> axes_{};
  Draws draws_;
};

}  // namespace drivebench::regression
