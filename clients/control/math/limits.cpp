#include "clients/control/math/limits.hpp"

#include <array>
#include <cstdio>
#include <stdexcept>

namespace drivebench::control {

std::string Exceeded::sentence() const {
  std::array<char, 96> numbers{};
  std::string text(demand.quantity);
  std::snprintf(numbers.data(), numbers.size(), " of %.4g ", std::abs(demand.value));
  text.append(numbers.data()).append(demand.unit);
  std::snprintf(numbers.data(), numbers.size(), " at %.4g s is above the limit of %.4g ", time_s,
                demand.limit);
  return text.append(numbers.data()).append(demand.unit);
}

void refuse(const std::optional<Exceeded>& exceeded) {
  if (exceeded) throw std::invalid_argument("the move cannot be made: " + exceeded->sentence());
}

}  // namespace drivebench::control
