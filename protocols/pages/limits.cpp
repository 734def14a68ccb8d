#include "protocols/pages/limits.hpp"

#include <charconv>
#include <cstdlib>
#include <string>
#include <system_error>

#include "protocols/text.hpp"

namespace drivebench::pages {
namespace {

// Limits beyond these keep numbers from overflowing; a motor has others.
constexpr double kNoLimit = 1e6;
constexpr double kAlmostZero = 1e-4;

constexpr bool is_almost_zero(double low) noexcept {
  return low > 0.0 && low <= kAlmostZero;
}

/// As CLI11 describes its own ranges.
std::string range_of(const std::string& low, const std::string& high) {
  return "[" + low + " - " + high + "]";
}

/// 1e15, where shortest() has 1e+15.
std::string plain(double value) {
  std::string text = shortest(value);
  const std::size_t e = text.find('e');
  if (e == std::string::npos) return text;
  std::string power = text.substr(e + 1);
  const std::string sign = power[0] == '-' ? "-" : "";
  power.erase(0, power.find_first_not_of("+-0"));
  return text.substr(0, e + 1) + sign + power;
}

/// ` from 1 to 127`: which numbers are right, told about one that is not. A limit against overflow is told of
/// a number beyond it alone.
std::string right_numbers(double low, double high, double wrong) {
  const bool no_most = high >= kNoLimit && !(wrong > high);
  const bool no_least = low <= -kNoLimit && !(wrong < low);
  if (no_least) return no_most ? "" : " up to " + plain(high);
  if (is_almost_zero(low) && !(wrong > 0.0 && wrong < low))
    return no_most ? " above 0" : " above 0 and at most " + plain(high);
  return no_most ? " of " + plain(low) + " or more" : " from " + plain(low) + " to " + plain(high);
}

}  // namespace

CLI::Validator finite_between(double low, double high) {
  return {[low, high](std::string& text) {
            double value = 0.0;
            const bool is_number = CLI::detail::lexical_cast(text, value);
            if (is_number && value >= low && value <= high) return std::string();
            return printable(text) + " is not a number" + right_numbers(low, high, is_number ? value : 0.0);
          },
          range_of(shortest(low), shortest(high))};
}

CLI::Validator whole_between(std::int64_t low, std::int64_t high) {
  return {[low, high](std::string& text) {
            std::int64_t value = 0;
            const char* const end = text.data() + text.size();
            const auto read = std::from_chars(text.data(), end, value);
            const bool is_whole = read.ec == std::errc{} && read.ptr == end;
            if (is_whole && value >= low && value <= high) return std::string();
            return printable(text) + " is not a whole number" +
                   right_numbers(static_cast<double>(low), static_cast<double>(high),
                                 std::strtod(text.c_str(), nullptr));
          },
          range_of(std::to_string(low), std::to_string(high))};
}

CLI::Validator not_negative() {
  return {[](std::string& text) {
            return text.find('-') == std::string::npos ? std::string() : text + " is negative";
          },
          ""};
}

std::string range_in_words(const std::string& range) {
  const std::size_t dash = range.find(" - ");
  if (dash == std::string::npos) return "";
  const std::string low = range.substr(0, dash);
  const std::string high = range.substr(dash + 3);
  const double least = std::strtod(low.c_str(), nullptr);
  const double most = std::strtod(high.c_str(), nullptr);
  const std::string from = is_almost_zero(least) ? "more than 0" : low;
  if (most < kNoLimit) return is_almost_zero(least) ? from + ", at most " + high : from + " to " + high;
  if (least <= -kNoLimit) return "";
  return is_almost_zero(least) ? from : from + " or more";
}

}  // namespace drivebench::pages
