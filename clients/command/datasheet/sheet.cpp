#include "clients/command/datasheet/sheet.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "clients/command/common/basics/errors.hpp"

namespace drivebench::command {
namespace {

/// A number of a form, as a formula.
std::string formula_of(const Form& form, double x, const Sheet& sheet) {
  return fmt::format(fmt::runtime(form.formula), fmt::arg("x", fmt::format("{:.10g}", x)),
                     fmt::arg("p", sheet.value("pole_pairs")),
                     fmt::arg("k", fmt::format("{:.6g}", sheet.value("torque_constant_nm_per_a"))),
                     fmt::arg("r", sheet.value("stator_resistance_ohm")), fmt::arg("f", sheet.at("rated-hz")),
                     fmt::arg("i", sheet.at("no-load-a")), fmt::arg("third", sheet.delta ? " / 3" : ""),
                     fmt::arg("root3", sheet.delta ? " / sqrt(3)" : ""));
}

/// Whole numbers are those of poles and counts.
std::string value_text(const Quantity& quantity, double value) {
  const bool whole = quantity.key == "pole_pairs" || quantity.key == "counts_per_revolution";
  if (!whole) return real(value);
  if (value != std::floor(value) || value < 1.0)
    throw UsageError(
        fmt::format("{} would be {:g} but must be a whole number above 0", quantity.title, value));
  return fmt::format("{:.0f}", value);
}

}  // namespace

bool agree(double a, double b) {
  return std::abs(a - b) <= kAgree * std::max(std::abs(a), std::abs(b));
}

std::string likely_mistake(double ratio) {
  struct Mistake {
    double factor;
    const char* what;
  };
  constexpr auto kMistakes = std::to_array<Mistake>(
      {{std::numbers::sqrt2, "sqrt(2): is one of them peak and the other rms?"},
       {std::numbers::sqrt3, "sqrt(3): is one of them of a phase and the other from line to line?"},
       {std::numbers::sqrt3 / std::numbers::sqrt2,
        "sqrt(3/2): is one of them of the power-invariant frame already?"},
       {1.5, "3/2: is one of them of the amplitude-invariant frame?"},
       {2.0, "2: poles for pole pairs, or line to line for a phase?"},
       {1000.0, "1000: a unit with milli or kilo?"}});
  const double above_one = std::max(ratio, 1.0 / ratio);
  for (const Mistake& each : kMistakes) {
    if (std::abs(above_one / each.factor - 1.0) < 0.04)
      return fmt::format("; the factor {:.4g} is nearly {}", above_one, each.what);
  }
  return "";
}

std::string option_of(const Form& form, double x) {
  return fmt::format("--{} {:.10g}", form.name, x);
}

std::string real(double value) {
  const std::string text = fmt::format("{:.7g}", value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

std::string in_quotes(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

bool is_given(const Quantity& quantity, const Sheet& sheet) {
  return std::ranges::any_of(quantity.forms, [&](const Form& form) { return sheet.has(form.name); });
}

FileLine line_of(const Quantity& quantity, Sheet& sheet) {
  FileLine line;
  line.key = quantity.key;
  const Form* first = nullptr;
  double value = 0.0;
  for (const Form& form : quantity.forms) {
    if (!sheet.has(form.name) || (form.only_alone && first != nullptr)) continue;
    const double x = sheet.at(form.name);
    const double made = form.made(x, sheet);
    if (first == nullptr) {
      first = &form;
      value = made;
      line.comment.push_back(fmt::format("{}: {}   [--{}, {}]", quantity.title, formula_of(form, x, sheet),
                                         form.name, form.unit));
      if (!form.why.empty()) line.comment.emplace_back(form.why);
    } else if (!agree(made, value)) {
      throw UsageError(fmt::format("{} makes {} {:.4g}, but {} makes it {:.4g}{}",
                                   option_of(*first, sheet.at(first->name)), quantity.title, value,
                                   option_of(form, x), made, likely_mistake(made / value)));
    } else {
      line.comment.push_back(
          fmt::format("{} agrees: {} = {:.4g}", option_of(form, x), formula_of(form, x, sheet), made));
    }
  }
  sheet.made[line.key] = value;
  line.value = value_text(quantity, value);
  return line;
}

}  // namespace drivebench::command
