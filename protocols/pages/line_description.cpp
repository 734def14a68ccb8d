#include "protocols/pages/line_description.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string_view>

namespace drivebench::pages {
namespace {

std::vector<std::string> split(std::string_view text, char at) {
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t end = text.find(at);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

/// CLI11 keeps type and validators as one text: `TEXT:{csv,candump}`, `INT:INT in [1 - 127]`.
void read_type(std::string_view type, LineOption& option) {
  const std::size_t colon = type.find(':');
  const std::string_view kind = type.substr(0, colon);
  option.value = kind == "INT" || kind == "UINT" || kind == "FLOAT" ? "NUMBER" : kind;
  if (colon == std::string_view::npos) return;
  const std::string_view rule = type.substr(colon + 1);
  const std::size_t open = rule.find_first_of("{[");
  if (open == std::string_view::npos) return;
  const std::string_view inside = rule.substr(open + 1, rule.find_first_of("}]", open) - open - 1);
  if (rule[open] == '{') {
    option.words = split(inside, ',');
  } else {
    option.range = inside;
  }
}

std::vector<std::string> sorted_names(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;  // a set of pointers has an order of its own at each run
  names.reserve(options.size());
  for (const CLI::Option* option : options)
    names.push_back(option->get_name());
  std::ranges::sort(names);
  return names;
}

LineOption describe_option(const CLI::Option& from) {
  LineOption option = {.text = from.get_description(),
                       .group = from.get_group(),
                       .default_value = from.get_default_str(),
                       .needs = sorted_names(from.get_needs()),
                       .excludes = sorted_names(from.get_excludes()),
                       .positional = from.get_positional(),
                       .required = from.get_required(),
                       .list = from.get_delimiter() == ','};
  if (option.positional) {
    option.names.push_back(from.get_name(true));
  } else {
    for (const std::string& name : from.get_snames())
      option.names.push_back("-" + name);
    for (const std::string& name : from.get_lnames())
      option.names.push_back("--" + name);
  }
  read_type(from.get_type_name(), option);
  return option;
}

LineVerb describe(const CLI::App& app, std::vector<std::string> path) {
  LineVerb verb = {.path = std::move(path),
                   .text = app.get_description(),
                   .footer = app.get_footer(),
                   .passes_on = app.get_prefix_command()};
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) verb.options.push_back(describe_option(*option));
  }
  for (const CLI::App* sub : app.get_subcommands(nullptr)) {
    std::vector<std::string> below = verb.path;
    below.push_back(sub->get_name());
    verb.verbs.push_back(describe(*sub, std::move(below)));
  }
  return verb;
}

}  // namespace

LineVerb describe_line(const CLI::App& app, const std::string& name) {
  LineVerb line = describe(app, {name});
  if (line.text.starts_with(name + ": ")) line.text.erase(0, name.size() + 2);
  return line;
}

std::vector<const LineVerb*> all_verbs(const LineVerb& verb) {
  std::vector<const LineVerb*> found = {&verb};
  for (const LineVerb& below : verb.verbs)
    std::ranges::copy(all_verbs(below), std::back_inserter(found));
  return found;
}

std::string joined(const std::vector<std::string>& path, const std::string& between) {
  std::string text;
  for (const std::string& word : path)
    text += (text.empty() ? "" : between) + word;
  return text;
}

}  // namespace drivebench::pages
