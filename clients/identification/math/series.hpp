#pragma once

#include <span>
#include <stdexcept>
#include <vector>

namespace drivebench::identification {

/// Equidistant samples of one signal.
using Series = std::vector<double>;
using SeriesView = std::span<const double>;

/// Data or options that cannot be used; what() is a sentence for the user.
class IdentificationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace drivebench::identification
