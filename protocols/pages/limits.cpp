#include "protocols/pages/limits.hpp"

#include <charconv>
#include <string>
#include <system_error>

#include "protocols/text.hpp"

namespace drivebench::pages {
namespace {

/// As CLI11 describes its own ranges.
std::string range_of(const std::string& low, const std::string& high) {
  return "[" + low + " - " + high + "]";
}

}  // namespace

CLI::Validator finite_between(double low, double high) {
  return {[low, high](std::string& text) {
            double value = 0.0;
            const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
            return good ? std::string()
                        : text + " is not a number from " + shortest(low) + " to " + shortest(high);
          },
          range_of(shortest(low), shortest(high))};
}

CLI::Validator whole_between(std::int64_t low, std::int64_t high) {
  return {[low, high](std::string& text) {
            std::int64_t value = 0;
            const char* const end = text.data() + text.size();
            const auto read = std::from_chars(text.data(), end, value);
            const bool good = read.ec == std::errc{} && read.ptr == end && value >= low && value <= high;
            return good ? std::string()
                        : text + " is not a whole number from " + std::to_string(low) + " to " +
                              std::to_string(high);
          },
          range_of(std::to_string(low), std::to_string(high))};
}

CLI::Validator not_negative() {
  return {[](std::string& text) {
            return text.find('-') == std::string::npos ? std::string() : text + " is negative";
          },
          ""};
}

}  // namespace drivebench::pages
