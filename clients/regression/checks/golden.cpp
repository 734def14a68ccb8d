#include "clients/regression/checks/golden.hpp"

#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <optional>

#include "protocols/document.hpp"
#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr std::size_t kMostBytes = 268'435'456;

/// Takes the piece before the separator off the front.
std::string_view take_until(std::string_view& rest, char separator) {
  const std::size_t end = rest.find(separator);
  const std::string_view piece = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  return piece;
}

std::string_view next_line(std::string_view& rest) {
  std::string_view line = take_until(rest, '\n');
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

template <class Number>
bool parse(std::string_view text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

std::optional<std::size_t> column_of(std::string_view header, std::string_view signal) {
  for (std::size_t column = 0; !header.empty(); ++column) {
    const std::string_view cell = take_until(header, ',');
    if (cell.substr(0, cell.find(" [")) == signal) return column;
  }
  return std::nullopt;
}

/// Appends a row; false: it is none.
bool append(std::string_view line, std::size_t column, Golden& golden) {
  std::uint64_t tick = 0;
  double value = 0.0;
  std::string_view cell = take_until(line, ',');
  if (!parse(cell, tick)) return false;
  if (!golden.ticks.empty() && tick <= golden.ticks.back()) return false;
  for (std::size_t i = 0; i < column; ++i)
    cell = take_until(line, ',');
  if (!parse(cell, value) || !std::isfinite(value)) return false;
  golden.ticks.push_back(tick);
  golden.values.push_back(value);
  return true;
}

}  // namespace

Golden read_golden(const std::string& file, std::string_view signal) {
  const auto refused = [&file](const std::string& why) {
    return Golden{.problem = fmt::format("names {}, {}", file, why)};
  };
  const FileText content = read_file(file, kMostBytes);
  if (!content.why_not.empty()) return refused("which " + content.why_not);
  std::string_view rest = content.text;
  const std::string_view header = next_line(rest);
  if (!header.starts_with("tick,")) return refused("whose first column is not tick: write it by `export`");
  const std::optional<std::size_t> column = column_of(header, signal);
  if (!column) return refused(fmt::format("which has no column {}", signal));
  Golden golden;
  for (int number = 2; !rest.empty(); ++number) {
    const std::string_view line = next_line(rest);
    if (!line.empty() && !append(line, *column, golden)) {
      return refused(
          fmt::format("whose line {} is \"{}\", no later tick with finite numbers", number, printable(line)));
    }
  }
  return golden.ticks.empty() ? refused("which has no rows") : golden;
}

}  // namespace drivebench::regression
