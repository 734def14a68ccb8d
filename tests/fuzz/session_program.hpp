#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>

namespace drivebench::fuzz {

/// Values that a client may write in place of a number.
inline constexpr auto kValues =
    std::to_array<double>({0.0, 1.0, -1.0, 5.0, -20.0, 80.0, -81.0, 1e-3, 0.5, 2.0, 1e9, -1e308, 5e-324,
                           std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity()});

/// The program; behind its end it reads zeros.
class Program {
 public:
  explicit Program(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  bool over() const { return bytes_.empty(); }
  unsigned next() {
    if (bytes_.empty()) return 0;
    const unsigned byte = bytes_.front();
    bytes_ = bytes_.subspan(1);
    return byte;
  }
  double value() {
    const double result = kValues[next() % kValues.size()];
    all_finite_ = all_finite_ && std::isfinite(result);
    return result;
  }
  /// Whether all values since the last call were numbers.
  bool all_finite() { return std::exchange(all_finite_, true); }
  std::string next_bytes() {
    const std::size_t wanted = next();
    const std::size_t count = std::min(wanted, bytes_.size());
    const std::string result(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(count));
    bytes_ = bytes_.subspan(count);
    return result;
  }

 private:
  std::span<const std::uint8_t> bytes_;
  bool all_finite_ = true;
};

}  // namespace drivebench::fuzz
