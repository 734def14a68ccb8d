#include "protocols/pages/help_text.hpp"

#include <algorithm>
#include <string_view>

namespace drivebench::pages {
namespace {

constexpr std::size_t kColumns = 80;
constexpr std::size_t kTextColumn = 26;

/// A name with its text in the second column, or below it if the name is long.
std::string row(const std::string& name, const std::string& text) {
  std::string out = "  " + name;
  if (text.empty()) return out + "\n";
  if (out.size() + 2 > kTextColumn) {
    out += "\n" + std::string(kTextColumn, ' ');
  } else {
    out.resize(kTextColumn, ' ');
  }
  return out + wrapped(text, kTextColumn);
}

/// `-h, --help`, `--mode realtime|lockstep`, `--port PORT`, `--signals SIGNAL,...`.
std::string name_of(const LineOption& option) {
  std::string names = joined(option.names, ", ");
  if (option.positional || option.value.empty()) return names;
  if (option.list) return names + " " + option.value + ",...";
  return names + " " + (option.words.empty() ? option.value : joined(option.words, "|"));
}

std::string usage(const LineVerb& verb) {
  std::string line = "Usage: " + joined(verb.path, " ");
  for (const LineOption& option : verb.options) {
    if (option.positional)
      line += option.required ? " " + option.names.front() : " [" + option.names.front() + "]";
  }
  for (const LineOption& option : verb.options)
    if (!option.positional && option.required) line += " " + name_of(option);
  line += verb.passes_on ? " [ARGUMENT ...]" : verb.verbs.empty() ? " [OPTION ...]" : " VERB [ARGUMENT ...]";
  return wrapped(line, 0);
}

template <class Shown>
void add_rows(std::string& out, const std::string& heading, const LineVerb& verb, Shown shown) {
  std::string rows;
  for (const LineOption& option : verb.options)
    if (shown(option)) rows += row(name_of(option), option.text + remarks(option));
  if (!rows.empty()) out += "\n" + heading + ":\n" + rows;
}

}  // namespace

std::string wrapped(std::string_view text, std::size_t column) {
  std::string out;
  std::size_t at = column;
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(std::min(text.size(), word.size() + 1));
    if (at > column && at + 1 + word.size() > kColumns) {
      out += "\n" + std::string(column, ' ');
      at = column;
    } else if (at > column) {
      out += ' ';
      ++at;
    }
    out += word;
    at += word.size();
  }
  return out + "\n";
}

std::string help_text(const LineVerb& verb) {
  std::string out = wrapped(joined(verb.path, " ") + ": " + verb.text, 0) + "\n" + usage(verb);
  add_rows(out, "Arguments", verb, [](const LineOption& option) { return option.positional; });
  for (const std::string& group : verb_groups(verb)) {
    out += "\n" + (group.empty() ? "Verbs" : group) + ":\n";
    for (const LineVerb& below : verb.verbs)
      if (below.group == group) out += row(below.path.back(), below.text);
  }
  for (const std::string& group : option_groups(verb)) {
    add_rows(out, group, verb,
             [&](const LineOption& option) { return !option.positional && option.group == group; });
  }
  if (!verb.notes.empty()) out += "\n" + wrapped(joined(verb.notes, " "), 0);
  if (!verb.examples.empty()) {
    out += verb.examples.size() == 1 ? "\nExample:\n" : "\nExamples:\n";
    for (const std::string& example : verb.examples)
      out += "  " + example + "\n";
  }
  if (!verb.exit_codes.empty()) out += "\n" + wrapped(joined(verb.exit_codes, " "), 0);
  return out;
}

}  // namespace drivebench::pages
