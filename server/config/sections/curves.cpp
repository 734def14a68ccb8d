#include "server/config/sections/curves.hpp"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <utility>

#include "protocols/text.hpp"
#include "server/config/words.hpp"

namespace drivebench {
namespace {

std::optional<double> number_of(const ConfigNode& node) {
  if (node.kind != ConfigNode::Kind::kScalar) return std::nullopt;
  if (const auto* integer = std::get_if<std::int64_t>(&node.scalar)) return static_cast<double>(*integer);
  const auto* real = std::get_if<double>(&node.scalar);
  return real != nullptr && std::isfinite(*real) ? std::optional(*real) : std::nullopt;
}

std::optional<CurvePoint> point_of(const ConfigNode& node) {
  if (node.kind != ConfigNode::Kind::kArray || node.children.size() != 2) return std::nullopt;
  const std::optional<double> x = number_of(node.children[0]);
  const std::optional<double> y = number_of(node.children[1]);
  return x && y ? std::optional(CurvePoint{*x, *y}) : std::nullopt;
}

std::optional<std::vector<CurvePoint>> inline_points(StrictTable& table, std::string_view key,
                                                     const ConfigNode& node) {
  if (node.kind != ConfigNode::Kind::kArray) {
    table.report(key, "must be points [[x, y], ...] or the name of a CSV file in quotes");
    return std::nullopt;
  }
  if (node.children.size() > kMaxCurvePoints) {
    table.report(key, "has " + std::to_string(node.children.size()) + " points but there may be " +
                          std::to_string(kMaxCurvePoints));
    return std::nullopt;
  }
  std::vector<CurvePoint> points;
  for (const ConfigNode& child : node.children) {
    const std::optional<CurvePoint> point = point_of(child);
    if (!point) {
      table.report_at(child.line, key,
                      "point " + std::to_string(points.size() + 1) + " must be two finite numbers: [x, y]");
      return std::nullopt;
    }
    points.push_back(*point);
  }
  return points;
}

std::optional<std::vector<CurvePoint>> points_of_file(StrictTable& table, const CurveParameter& row,
                                                      std::string_view key,
                                                      const std::filesystem::path& folder,
                                                      ProblemList& problems) {
  const std::optional<std::string> name = table.text(key, 800);
  if (!name) return std::nullopt;
  if (folder.empty()) {
    table.report(key, std::string(kNoOtherFiles));
    return std::nullopt;
  }
  const std::string path = (folder / *name).lexically_normal().string();
  const FileText file = read_file(path, kMaxCurveFileBytes);
  if (!file.why_not.empty()) {
    table.report(key, "names " + path + ", which " + file.why_not);
    return std::nullopt;
  }
  return parse_curve_csv(file.text, path, row.rising, problems);
}

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

std::optional<double> number_of(std::string_view text) {
  text = trimmed(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc{} && end == text.data() + text.size() && std::isfinite(value);
  return whole ? std::optional(value) : std::nullopt;
}

/// Takes the next line, without its end, off the front of `rest`.
std::string_view next_line(std::string_view& rest) {
  const std::size_t end = rest.find('\n');
  std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return trimmed(line);
}

/// The problem of the next point of a curve; empty: none.
std::string misfit(const std::vector<CurvePoint>& points, const CurvePoint& point, bool rising) {
  if (points.size() == kMaxCurvePoints) {
    return "is one more than the " + std::to_string(kMaxCurvePoints) + " points that there may be";
  }
  if (points.empty()) return {};
  if (!(point.x > points.back().x)) {
    return "x is " + shortest(point.x) + " but must be greater than the x before it, " +
           shortest(points.back().x);
  }
  if (rising && !(point.y > points.back().y)) {
    return "y is " + shortest(point.y) + " but must be greater than the y before it, " +
           shortest(points.back().y);
  }
  return {};
}

}  // namespace

std::optional<std::vector<CurvePoint>> parse_curve_csv(std::string_view text, const std::string& file,
                                                       bool rising, ProblemList& problems) {
  std::vector<CurvePoint> points;
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  bool may_be_header = true;
  for (int line = 1; !text.empty(); ++line) {
    const std::string_view content = next_line(text);
    if (content.empty()) continue;
    const std::size_t comma = content.find(',');
    const std::string_view second = comma == std::string_view::npos ? "" : content.substr(comma + 1);
    const std::optional<double> x = number_of(content.substr(0, comma));
    const std::optional<double> y = number_of(second);
    const bool is_header = may_be_header && !x && !y && comma != std::string_view::npos;
    may_be_header = false;
    if (is_header) continue;
    std::string rule;
    if (!x || !y) {
      rule = "is \"" + printable(content) + "\" but must be two finite numbers, x,y";
    } else {
      rule = misfit(points, {*x, *y}, rising);
    }
    if (!rule.empty()) {
      problems.add(file, line, {}, std::move(rule));
      return std::nullopt;
    }
    points.push_back({*x, *y});
  }
  if (points.size() >= 2) return points;
  problems.add(file, 0, {}, "has " + std::to_string(points.size()) + " points but a curve needs two");
  return std::nullopt;
}

std::optional<Curve> read_curve(StrictTable& table, const CurveParameter& row,
                                const std::filesystem::path& folder, ProblemList& problems) {
  const std::string_view key = row.name.substr(row.name.find('.') + 1);
  const ConfigNode* const node = table.node(key);
  if (node == nullptr) return std::nullopt;
  const bool names_file = std::holds_alternative<std::string>(node->scalar);
  std::optional<std::vector<CurvePoint>> points =
      names_file ? points_of_file(table, row, key, folder, problems) : inline_points(table, key, *node);
  if (!points) return std::nullopt;
  if (std::string rule = problem_with_points(*points, row.rising); !rule.empty()) {
    table.report(key, std::move(rule));
    return std::nullopt;
  }
  return Curve(std::move(*points));
}

std::string curve_text(const Curve& curve) {
  constexpr std::size_t kPerLine = 8;
  std::string text = "[";
  const std::vector<CurvePoint>& points = curve.points();
  for (std::size_t i = 0; i < points.size(); ++i) {
    text += i % kPerLine == 0 ? "\n  " : " ";
    text.append("[").append(real_text(points[i].x)).append(", ").append(real_text(points[i].y)).append("],");
  }
  return text + "\n]";
}

}  // namespace drivebench
