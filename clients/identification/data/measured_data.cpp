#include "clients/identification/data/measured_data.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

namespace drivebench::identification {
namespace {

constexpr std::size_t kMostColumns = 1000;
constexpr std::size_t kLongestShown = 40;
constexpr std::uintmax_t kLargestFile = std::uintmax_t{1} << 31;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

/// Untrusted text for a message: short, without control characters.
std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, kLongestShown))
    out += c >= ' ' && c <= '~' ? c : '?';
  return out + (text.size() > kLongestShown ? "..." : "");
}

struct Cursor {
  const std::string& source;
  std::size_t line = 0;

  [[noreturn]] void fail(std::string_view column, const std::string& rule) const {
    throw IdentificationError(
        fmt::format("{}:{}: {}{}{}", source, line, shown(column), column.empty() ? "" : ": ", rule));
  }
};

std::vector<std::string_view> cells_of(std::string_view line, char separator) {
  std::vector<std::string_view> cells;
  while (true) {
    const std::size_t end = line.find(separator);
    std::string_view cell = trimmed(line.substr(0, end));
    if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"')
      cell = trimmed(cell.substr(1, cell.size() - 2));
    cells.push_back(cell);
    if (end == std::string_view::npos) return cells;
    line.remove_prefix(end + 1);
  }
}

/// Takes the next line, without its end; nothing at the end of the text.
std::optional<std::string_view> next_line(std::string_view& text, Cursor& cursor) {
  if (text.empty()) return std::nullopt;
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  ++cursor.line;
  return trimmed(line);
}

struct Header {
  std::string_view full;
  std::string_view name;
  std::string_view unit;
};

Header split_header(std::string_view full) {
  const std::size_t open = full.rfind('[');
  if (open == std::string_view::npos || !full.ends_with(']')) return {full, full, {}};
  return {full, trimmed(full.substr(0, open)), full.substr(open + 1, full.size() - open - 2)};
}

std::vector<Header> read_header(std::string_view line, char separator, const Cursor& cursor) {
  std::vector<Header> headers;
  for (const std::string_view cell : cells_of(line, separator))
    headers.push_back(split_header(cell));
  if (headers.size() > kMostColumns) cursor.fail({}, fmt::format("more than {} columns", kMostColumns));
  for (std::size_t k = 0; k < headers.size(); ++k) {
    const Header& h = headers[k];
    if (h.name.empty())
      cursor.fail({}, fmt::format("column {} has no name; the first line must name the columns", k + 1));
    double ignored = 0.0;
    if (std::from_chars(h.full.data(), h.full.data() + h.full.size(), ignored).ec == std::errc() &&
        h.full.find_first_not_of("+-.0123456789eE") == std::string_view::npos)
      cursor.fail(h.full,
                  "a number where the name of a column is expected; the first line must name the columns");
    for (std::size_t j = 0; j < k; ++j) {
      if (headers[j].name == h.name) cursor.fail(h.name, "two columns have this name");
    }
  }
  return headers;
}

std::size_t find_header(const std::vector<Header>& headers, std::string_view wanted, const Cursor& cursor) {
  for (std::size_t k = 0; k < headers.size(); ++k) {
    if (headers[k].name == wanted || headers[k].full == wanted) return k;
  }
  std::string names;
  for (const Header& h : headers)
    names += (names.empty() ? "" : ", ") + shown(h.name);
  cursor.fail(wanted, "no such column; there are " + names);
}

double number_of(std::string_view cell, std::string_view column, const Cursor& cursor) {
  if (cell.starts_with('+')) cell.remove_prefix(1);
  double x = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), x);
  if (cell.empty()) cursor.fail(column, "empty; every row needs a number in every column that is used");
  if (end != cell.data() + cell.size() || error == std::errc::invalid_argument)
    cursor.fail(column, "'" + shown(cell) + "' is not a number (decimal point, no thousands separator)");
  if (error == std::errc::result_out_of_range) {
    cursor.fail(column, "'" + shown(cell) + "' is beyond what a double holds");
  }
  if (!std::isfinite(x)) cursor.fail(column, "'" + shown(cell) + "' is not finite");
  return x;
}

/// A column to read: its place and its conversion.
struct Taken {
  std::size_t at;
  double factor;
  double offset;
  Column column;
};

std::vector<Taken> choose(const std::vector<Header>& headers, const CsvOptions& options,
                          const Cursor& cursor) {
  std::vector<Taken> taken;
  for (const ColumnMap& map : options.columns) {
    const std::size_t at = find_header(headers, map.header.empty() ? map.name : map.header, cursor);
    if (!std::isfinite(map.factor) || map.factor == 0.0 || !std::isfinite(map.offset))
      cursor.fail(map.name, "factor and offset of a column must be finite, the factor not 0");
    for (const Taken& other : taken) {
      if (other.column.name == map.name) cursor.fail(map.name, "the column map gives this signal twice");
    }
    taken.push_back({at, map.factor, map.offset, {map.name, std::string(headers[at].unit), {}}});
  }
  if (!options.columns.empty()) return taken;
  for (std::size_t k = 0; k < headers.size(); ++k)
    taken.push_back({k, 1.0, 0.0, {std::string(headers[k].name), std::string(headers[k].unit), {}}});
  return taken;
}

/// The period of the times; each step must be within 1 % of the mean.
double period_of(const Series& time_s, std::string_view column, Cursor cursor) {
  if (time_s.size() < 2) cursor.fail(column, "a period needs two rows at least");
  const double period = (time_s.back() - time_s.front()) / static_cast<double>(time_s.size() - 1);
  for (std::size_t k = 1; k < time_s.size(); ++k) {
    cursor.line = k + 2;
    const double step = time_s[k] - time_s[k - 1];
    if (!(step > 0.0)) cursor.fail(column, "time does not rise");
  }
  for (std::size_t k = 1; k < time_s.size(); ++k) {
    cursor.line = k + 2;
    const double step = time_s[k] - time_s[k - 1];
    if (std::abs(step - period) > 0.01 * period)
      cursor.fail(column,
                  fmt::format("a step of {} s where the mean is {} s: rows are lost, or the rate changed",
                              step, period));
  }
  return period;
}

}  // namespace

const Column* MeasuredData::find(std::string_view name) const noexcept {
  const auto found =
      std::find_if(columns.begin(), columns.end(), [&](const Column& c) { return c.name == name; });
  return found == columns.end() ? nullptr : &*found;
}

SeriesView MeasuredData::at(std::string_view name) const {
  if (const Column* column = find(name)) return column->values;
  std::string names;
  for (const Column& c : columns)
    names += (names.empty() ? "" : ", ") + shown(c.name);
  throw IdentificationError(fmt::format("the data have no column {}; there are {}", name, names));
}

MeasuredData parse_csv(std::string_view text, const std::string& source, const CsvOptions& options) {
  Cursor cursor{source};
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  const auto first = next_line(text, cursor);
  if (!first || first->empty()) {
    cursor.line = 1;
    cursor.fail({}, "the first line must name the columns; it is empty");
  }
  const char separator = first->find(';') != std::string_view::npos ? ';' : ',';
  const std::vector<Header> headers = read_header(*first, separator, cursor);
  std::vector<Taken> taken = choose(headers, options, cursor);
  std::optional<std::size_t> time;
  Series time_s;
  if (options.period_s == 0.0) time = find_header(headers, options.time, cursor);
  if (!time && !(options.period_s > 0.0 && std::isfinite(options.period_s)))
    cursor.fail({}, "the period must be positive");
  if (!(options.time_factor > 0.0 && std::isfinite(options.time_factor)))
    cursor.fail(options.time, "the factor of the time must be positive");

  std::optional<std::size_t> blank;
  while (const auto line = next_line(text, cursor)) {
    if (line->empty()) {
      if (!blank) blank = cursor.line;
      continue;
    }
    if (blank) {
      cursor.line = *blank;
      cursor.fail({}, "an empty line in the middle of the data");
    }
    const std::vector<std::string_view> cells = cells_of(*line, separator);
    if (cells.size() != headers.size())
      cursor.fail(
          {}, fmt::format("{} values where the first line names {} columns", cells.size(), headers.size()));
    if (time) time_s.push_back(options.time_factor * number_of(cells[*time], headers[*time].name, cursor));
    for (Taken& t : taken)
      t.column.values.push_back(t.factor * number_of(cells[t.at], headers[t.at].name, cursor) + t.offset);
  }
  MeasuredData data;
  data.period_s = time ? period_of(time_s, headers[*time].name, cursor) : options.period_s;
  for (Taken& t : taken)
    data.columns.push_back(std::move(t.column));
  if (data.samples() == 0) cursor.fail({}, "no rows");
  return data;
}

MeasuredData read_csv(const std::filesystem::path& file, const CsvOptions& options) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  std::ifstream in(file, std::ios::binary);
  if (error || !in) throw IdentificationError(file.string() + ": cannot be read");
  if (size > kLargestFile) throw IdentificationError(file.string() + ": larger than 2 GiB");
  std::string text(static_cast<std::size_t>(size), '\0');
  in.read(text.data(), static_cast<std::streamsize>(size));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return parse_csv(text, file.string(), options);
}

}  // namespace drivebench::identification
