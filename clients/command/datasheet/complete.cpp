// What the options left out: asked for on a terminal, told elsewhere.
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <optional>
#include <string>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/text.hpp"
#include "clients/command/datasheet/sheet.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

bool on_a_terminal() {
  return ::isatty(STDIN_FILENO) == 1 && ::isatty(STDERR_FILENO) == 1;
}

std::string options_of(const Quantity& quantity) {
  std::string text;
  for (const Form& form : quantity.forms)
    text += fmt::format("{}--{} [{}]", text.empty() ? "" : " or ", form.name, form.unit);
  return text;
}

/// Nothing if the line is no number of this form.
std::optional<double> number_in(const Form& form, std::string_view text) {
  const std::optional<double> x = finite_number(text);
  if (x && *x >= form.least && *x <= form.most) return x;
  fmt::print(stderr, "  '{}' is not a number from {:g} to {:g}\n", printable(text), form.least, form.most);
  return std::nullopt;
}

/// The first word of a line and the rest.
std::pair<std::string_view, std::string_view> split(std::string_view line) {
  const std::size_t blank = line.find(' ');
  if (blank == std::string_view::npos) return {line, {}};
  return {line.substr(0, blank), line.substr(blank + 1)};
}

std::string read_line() {
  std::string line;
  if (!std::getline(std::cin, line)) throw UsageError("the answers ended before the questions");
  return line;
}

/// Asks until there is an answer: a number, or where there are several forms the name of one and a number.
void ask(const Quantity& quantity, Sheet& sheet) {
  const bool one = quantity.forms.size() == 1;
  fmt::print(stderr, "{}\n", quantity.title);
  for (const Form& form : quantity.forms)
    fmt::print(stderr, "  {:<22} {:<20} {}\n", form.name, form.unit, form.meaning);
  for (;;) {
    fmt::print(stderr, "{}",
               one ? fmt::format("[{}]: ", quantity.forms[0].unit)
                   : fmt::format("form and number, such as '{} 1.5': ", quantity.forms[0].name));
    const std::string line = read_line();
    const auto [name, number] = one ? std::pair(quantity.forms[0].name, std::string_view(line)) : split(line);
    const auto form = std::ranges::find(quantity.forms, name, &Form::name);
    if (form == quantity.forms.end()) {
      fmt::print(stderr, "  '{}' is none of these forms\n", printable(name));
    } else if (const std::optional<double> x = number_in(*form, number)) {
      sheet.given[std::string(form->name)] = *x;
      return;
    }
  }
}

}  // namespace

void complete(std::span<const Quantity> missing, Sheet& sheet) {
  if (missing.empty()) return;
  if (on_a_terminal()) {
    for (const Quantity& quantity : missing)
      ask(quantity, sheet);
    return;
  }
  std::string text;
  for (const Quantity& quantity : missing)
    text += fmt::format("\n  {}: {}", quantity.title, options_of(quantity));
  throw UsageError("missing, or answer the questions on a terminal:" + text);
}

}  // namespace drivebench::command
