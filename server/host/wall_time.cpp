#include "server/host/wall_time.hpp"

#include <array>
#include <charconv>
#include <cstdio>

namespace drivebench {
namespace {

/// Takes numbers of fixed width and separators off the front of a text.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : rest_(text) {}

  int number(std::size_t digits) {
    int value = 0;
    const std::string_view part = rest_.substr(0, digits);
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    ok_ =
        ok_ && part.size() == digits && error == std::errc{} && end == part.data() + digits && part[0] != '-';
    rest_.remove_prefix(part.size());
    return value;
  }
  void mark(char expected) {
    ok_ = ok_ && rest_.starts_with(expected);
    if (ok_) rest_.remove_prefix(1);
  }
  bool skip(char c) {
    if (!rest_.starts_with(c)) return false;
    rest_.remove_prefix(1);
    return true;
  }
  bool ok() const { return ok_; }
  bool at_end() const { return rest_.empty(); }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

}  // namespace

std::optional<std::chrono::sys_seconds> parse_rfc3339(std::string_view text) {
  using namespace std::chrono;
  Scanner scan(text);
  const int y = scan.number(4);
  scan.mark('-');
  const int m = scan.number(2);
  scan.mark('-');
  const int d = scan.number(2);
  scan.mark('T');
  const int hour = scan.number(2);
  scan.mark(':');
  const int minute = scan.number(2);
  scan.mark(':');
  const int second = scan.number(2);
  seconds offset{0};
  if (!scan.skip('Z')) {
    const bool west = scan.skip('-');
    if (!west) scan.mark('+');
    const int offset_hours = scan.number(2);
    scan.mark(':');
    const int offset_minutes = scan.number(2);
    if (offset_hours > 23 || offset_minutes > 59) return std::nullopt;
    offset = (hours(offset_hours) + minutes(offset_minutes)) * (west ? -1 : 1);
  }
  const year_month_day date{year(y), month(static_cast<unsigned>(m)), day(static_cast<unsigned>(d))};
  if (!scan.ok() || !scan.at_end() || !date.ok() || y < 1970 || y > 2199 || hour > 23 || minute > 59 ||
      second > 59)
    return std::nullopt;
  return sys_days(date) + hours(hour) + minutes(minute) + seconds(second) - offset;
}

std::string rfc3339(std::chrono::system_clock::time_point time) {
  using namespace std::chrono;
  const auto whole = floor<microseconds>(time);
  const auto midnight = floor<days>(whole);
  const year_month_day date(midnight);
  const hh_mm_ss clock(whole - midnight);
  std::array<char, 48> text{};
  const int size = std::snprintf(
      text.data(), text.size(), "%04d-%02u-%02uT%02d:%02d:%02d.%06dZ", static_cast<int>(date.year()),
      static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
      static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
      static_cast<int>(clock.seconds().count()), static_cast<int>(clock.subseconds().count()));
  return {text.data(), static_cast<std::size_t>(size)};
}

}  // namespace drivebench
