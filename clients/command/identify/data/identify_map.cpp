#include "clients/command/identify/data/identify_map.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/identify/data/identify_options.hpp"
#include "protocols/document.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

using identification::ColumnMap;
using identification::CsvOptions;

constexpr std::string_view kForm = "HEADER=SIGNAL, HEADER=SIGNAL*FACTOR or HEADER=SIGNAL*FACTOR+OFFSET";

/// A number that may begin with a plus.
std::optional<double> signed_number(std::string_view text) {
  return finite_number(text.substr(text.starts_with('+') ? 1 : 0));
}

/// Signals that an identification reads.
constexpr std::array<std::string_view, 9> kWanted = {"i_a_a", "i_b_a",   "i_c_a",         "u_a_v",    "u_b_v",
                                                     "u_c_v", "load_nm", "encoder_count", "angle_rad"};

std::string wanted_signals() {
  return listed(kWanted);
}

bool is_wanted(std::string_view name) {
  return std::ranges::find(kWanted, name) != kWanted.end();
}

/// The end of the factor in SIGNAL*FACTOR+OFFSET: a sign that belongs to no exponent.
std::size_t end_of_factor(std::string_view text) {
  for (std::size_t k = 1; k < text.size(); ++k) {
    if ((text[k] == '+' || text[k] == '-') && text[k - 1] != 'e' && text[k - 1] != 'E') return k;
  }
  return text.size();
}

/// Fills CsvOptions from a column-map file.
class MapReader {
 public:
  MapReader(std::string file, ProblemList& problems) : file_(std::move(file)), problems_(problems) {}

  CsvOptions read(const ConfigNode& document) {
    for (const ConfigNode& child : document.children) {
      if (child.key == "time") {
        if (const auto text = text_of(child, "time")) options_.time = *text;
      } else if (child.key == "time_factor") {
        if (const auto value = positive(child, "time_factor")) options_.time_factor = *value;
      } else if (child.key == "period_s") {
        if (const auto value = positive(child, "period_s")) options_.period_s = *value;
      } else if (child.key == "columns" && child.kind == ConfigNode::Kind::kTable) {
        for (const ConfigNode& column : child.children)
          read_column(column);
      } else {
        report(child, child.key, "is not known here; there are time, time_factor, period_s and [columns]");
      }
    }
    return options_;
  }

 private:
  void report(const ConfigNode& node, const std::string& key, std::string rule) {
    problems_.add(file_, node.line, printable(key), std::move(rule));
  }
  std::optional<std::string> text_of(const ConfigNode& node, const std::string& key) {
    const auto* const text = std::get_if<std::string>(&node.scalar);
    if (node.kind == ConfigNode::Kind::kScalar && text != nullptr && !text->empty()) return *text;
    report(node, key, "must be text, the header of a column");
    return std::nullopt;
  }
  std::optional<double> number(const ConfigNode& node, const std::string& key) {
    if (node.kind == ConfigNode::Kind::kScalar) {
      if (const auto* real = std::get_if<double>(&node.scalar); real != nullptr && std::isfinite(*real))
        return *real;
      if (const auto* whole = std::get_if<std::int64_t>(&node.scalar)) return static_cast<double>(*whole);
    }
    report(node, key, "must be a finite number");
    return std::nullopt;
  }
  std::optional<double> positive(const ConfigNode& node, const std::string& key) {
    const auto value = number(node, key);
    if (!value || *value > 0.0) return value;
    report(node, key, "must be above 0");
    return std::nullopt;
  }
  void read_column(const ConfigNode& node) {
    const std::string key = "columns." + node.key;
    if (!is_wanted(node.key))
      return report(node, key, "is no signal for this; there are " + wanted_signals());
    ColumnMap column{.name = node.key, .header = {}};
    if (node.kind != ConfigNode::Kind::kTable) {
      if (const auto header = text_of(node, key)) column.header = *header;
    } else {
      read_details(node, key, column);
    }
    options_.columns.push_back(std::move(column));
  }
  void read_details(const ConfigNode& node, const std::string& key, ColumnMap& column) {
    for (const ConfigNode& child : node.children) {
      const std::string path = key + "." + child.key;
      if (child.key == "header") {
        if (const auto header = text_of(child, path)) column.header = *header;
      } else if (child.key == "factor") {
        if (const auto factor = number(child, path)) column.factor = *factor;
        if (column.factor == 0.0) report(child, path, "must not be 0");
      } else if (child.key == "offset") {
        if (const auto offset = number(child, path)) column.offset = *offset;
      } else {
        report(child, path, "is not known here; there are header, factor and offset");
      }
    }
  }

  std::string file_;
  ProblemList& problems_;
  CsvOptions options_;
};

CsvOptions load_column_map(const std::string& file) {
  const FileText read = read_file(file, kMaxConfigBytes);
  if (!read.why_not.empty()) throw UsageError(fmt::format("--map: the file {} {}", file, read.why_not));
  try {
    return parse_column_map(read.text, file);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

}  // namespace

ColumnMap parse_column(std::string_view text) {
  const auto wrong = [&](const std::string& rule) {
    return UsageError(fmt::format("--map '{}': {}", printable(text), rule));
  };
  const std::size_t equal = text.rfind('=');
  if (equal == std::string_view::npos || equal == 0 || equal + 1 == text.size())
    throw wrong(fmt::format("should be {}, or a file that ends with .toml", kForm));
  ColumnMap column{.name = {}, .header = std::string(text.substr(0, equal))};
  std::string_view rest = text.substr(equal + 1);
  const std::size_t star = rest.find('*');
  column.name = rest.substr(0, star);
  if (!is_wanted(column.name))
    throw wrong(
        fmt::format("'{}' is no signal for this; there are {}", printable(column.name), wanted_signals()));
  if (star == std::string_view::npos) return column;
  rest.remove_prefix(star + 1);
  const std::size_t end = end_of_factor(rest);
  const auto factor = signed_number(rest.substr(0, end));
  const auto offset = end < rest.size() ? signed_number(rest.substr(end)) : 0.0;
  if (!factor || *factor == 0.0 || !offset)
    throw wrong(fmt::format("'{}' should be a factor other than 0, or one and an offset: {}", printable(rest),
                            kForm));
  column.factor = *factor;
  column.offset = *offset;
  return column;
}

CsvOptions parse_column_map(std::string_view text, const std::string& file) {
  ProblemList problems;
  CsvOptions options;
  if (const auto document = parse_document(text, file, problems))
    options = MapReader(file, problems).read(*document);
  problems.throw_if_any();
  return options;
}

CsvOptions csv_options(const IdentifyOptions& options) {
  CsvOptions csv;
  for (const std::string& map : options.maps) {
    if (!map.ends_with(".toml")) {
      csv.columns.push_back(parse_column(map));
      continue;
    }
    CsvOptions file = load_column_map(map);
    std::ranges::move(csv.columns, std::back_inserter(file.columns));
    csv = std::move(file);
  }
  if (!options.time.empty()) csv.time = options.time;
  if (options.period_s) csv.period_s = *options.period_s;
  return csv;
}

}  // namespace drivebench::command
