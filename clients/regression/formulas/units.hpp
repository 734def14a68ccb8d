#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace drivebench::regression {

/// The dimension of a quantity: exponents of kg, m, s, A, K. Angles, counts and bits have none.
struct Dimension {
  std::array<int, 5> exponents{};

  bool operator==(const Dimension&) const = default;
  Dimension operator*(const Dimension& other) const noexcept;
  Dimension operator/(const Dimension& other) const noexcept;
  Dimension power(int n) const noexcept;
  /// Nothing if an exponent is odd.
  std::optional<Dimension> root() const noexcept;
};

/// The dimension of a unit as signals have it, or of a product such as "N*m/s^2"; nothing if it is none. The
/// factor of every unit is 1: there are no "rpm" and no "mA".
std::optional<Dimension> dimension_of(std::string_view unit);

/// The unit of a dimension: "W", "N*m", or in base units, "kg*m/s^3". "1": none.
std::string unit_of(const Dimension& dimension);

}  // namespace drivebench::regression
