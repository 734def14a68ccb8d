#include "clients/regression/formulas/units.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>

namespace drivebench::regression {
namespace {

struct NamedUnit {
  std::string_view name;
  Dimension dimension;
};

// kg, m, s, A, K. The first name of a dimension is the one that is printed.
constexpr auto kUnits = std::to_array<NamedUnit>({
    {"1", {}},
    {"A", {{0, 0, 0, 1, 0}}},
    {"V", {{1, 2, -3, -1, 0}}},
    {"W", {{1, 2, -3, 0, 0}}},
    {"N*m", {{1, 2, -2, 0, 0}}},
    {"J", {{1, 2, -2, 0, 0}}},
    {"Wb", {{1, 2, -2, -1, 0}}},
    {"ohm", {{1, 2, -3, -2, 0}}},
    {"H", {{1, 2, -2, -2, 0}}},
    {"F", {{-1, -2, 4, 2, 0}}},
    {"N", {{1, 1, -2, 0, 0}}},
    {"rad/s", {{0, 0, -1, 0, 0}}},
    {"Hz", {{0, 0, -1, 0, 0}}},
    {"rad", {}},
    {"counts", {}},
    {"bits", {}},
    {"enum", {}},
    {"clocks", {}},
    {"ticks", {}},
    {"kg", {{1, 0, 0, 0, 0}}},
    {"m", {{0, 1, 0, 0, 0}}},
    {"s", {{0, 0, 1, 0, 0}}},
    {"K", {{0, 0, 0, 0, 1}}},
    {"var", {{1, 2, -3, 0, 0}}},
});
constexpr std::array<std::string_view, 5> kBase{"kg", "m", "s", "A", "K"};
constexpr int kHighestPower = 9;

/// A unit of the table, with an exponent if it has one: "s^2".
std::optional<Dimension> factor_of(std::string_view text) {
  const std::size_t hat = text.find('^');
  const auto found = std::ranges::find(kUnits, text.substr(0, hat), &NamedUnit::name);
  if (found == kUnits.end()) return std::nullopt;
  if (hat == std::string_view::npos) return found->dimension;
  int power = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + hat + 1, end, power);
  if (error != std::errc{} || stop != end || power < -kHighestPower || power > kHighestPower)
    return std::nullopt;
  return found->dimension.power(power);
}

void append(std::string& text, std::string_view name, int power, char sign) {
  if (!text.empty()) text += sign;
  if (text.empty() && sign == '/') text = "1/";
  text += name;
  if (power != 1) text += "^" + std::to_string(power);
}

}  // namespace

Dimension Dimension::operator*(const Dimension& other) const noexcept {
  Dimension product = *this;
  for (std::size_t i = 0; i < exponents.size(); ++i)
    product.exponents[i] += other.exponents[i];
  return product;
}

Dimension Dimension::operator/(const Dimension& other) const noexcept {
  return *this * other.power(-1);
}

Dimension Dimension::power(int n) const noexcept {
  Dimension result = *this;
  for (int& each : result.exponents)
    each *= n;
  return result;
}

std::optional<Dimension> Dimension::root() const noexcept {
  Dimension result = *this;
  for (int& each : result.exponents) {
    if (each % 2 != 0) return std::nullopt;
    each /= 2;
  }
  return result;
}

std::optional<Dimension> dimension_of(std::string_view unit) {
  Dimension all;
  char sign = '*';
  for (;;) {
    const std::size_t end = unit.find_first_of("*/");
    const auto factor = factor_of(unit.substr(0, end));
    if (!factor) return std::nullopt;
    all = sign == '*' ? all * *factor : all / *factor;
    if (end == std::string_view::npos) return all;
    sign = unit[end];
    unit.remove_prefix(end + 1);
  }
}

std::string unit_of(const Dimension& dimension) {
  const auto found = std::ranges::find(kUnits, dimension, &NamedUnit::dimension);
  if (found != kUnits.end()) return std::string(found->name);
  std::string text;
  for (std::size_t i = 0; i < kBase.size(); ++i) {
    if (dimension.exponents[i] > 0) append(text, kBase[i], dimension.exponents[i], '*');
  }
  for (std::size_t i = 0; i < kBase.size(); ++i) {
    if (dimension.exponents[i] < 0) append(text, kBase[i], -dimension.exponents[i], '/');
  }
  return text;
}

}  // namespace drivebench::regression
