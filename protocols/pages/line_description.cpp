#include "protocols/pages/line_description.hpp"

#include "protocols/pages/limits.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace drivebench::pages {
namespace {

/// The line above the examples of a footer.
constexpr const char* kExample = "Example:";

std::vector<std::string> split(std::string_view text, char at) {
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t end = text.find(at);
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

/// CLI11 keeps type and validators as one text: `MODE:{realtime,lockstep}`, `FROM:TO`, `NUMBER:INT in [1 -
/// 127]`.
void read_type(const std::string& type, LineOption& option) {
  const std::size_t rule = std::min(
      {type.find(":{"), type.find(":["), type.find(":INT in ["), type.find(":UINT in ["), type.size()});
  option.value = type.substr(0, rule);
  const std::size_t open = type.find_first_of("{[", rule);
  if (open == std::string::npos) return;
  const std::string inside = type.substr(open + 1, type.find_first_of("}]", open) - open - 1);
  if (type[open] == '{') {
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
  const bool many = from.get_expected_max() >= CLI::detail::expected_max_vector_size;
  LineOption option = {.text = from.get_description(),
                       .group = from.get_group(),
                       .default_value = from.get_default_str(),
                       .needs = sorted_names(from.get_needs()),
                       .excludes = sorted_names(from.get_excludes()),
                       .positional = from.get_positional(),
                       .required = from.get_required(),
                       .list = many && from.get_delimiter() == ',',
                       .repeats = many && from.get_delimiter() != ','};
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

/// The footer has examples as indented lines, exit codes as lines that start with "Exit code", and notes.
void read_footer(std::string_view footer, LineVerb& verb) {
  for (const std::string& line : split(footer, '\n')) {
    if (line.starts_with("  ")) {
      verb.examples.push_back(line.substr(2));
    } else if (line.starts_with("Exit code")) {
      verb.exit_codes.push_back(line);
    } else if (!line.empty() && line != kExample) {
      verb.notes.push_back(line);
    }
  }
}

/// CLI11 hands the footer of a verb on to those below. Of it they take the exit codes, if they have none.
void read_footers(const CLI::App& app, LineVerb& verb) {
  const CLI::App* const above = app.get_parent();
  if (above == nullptr || app.get_footer() != above->get_footer()) read_footer(app.get_footer(), verb);
  if (above == nullptr || verb.passes_on || !verb.exit_codes.empty()) return;
  LineVerb whole;
  read_footers(*above, whole);
  verb.exit_codes = std::move(whole.exit_codes);
}

LineVerb describe(const CLI::App& app, std::vector<std::string> path) {
  LineVerb verb = {
      .path = std::move(path), .text = app.get_description(), .passes_on = app.get_prefix_command()};
  read_footers(app, verb);
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    verb.options.push_back(describe_option(*option));
    if (option == app.get_help_ptr()) verb.options.back().group = kHelp;
  }
  for (const CLI::App* sub : app.get_subcommands(nullptr)) {
    std::vector<std::string> below = verb.path;
    below.push_back(sub->get_name());
    verb.verbs.push_back(describe(*sub, std::move(below)));
  }
  if (!verb.examples.empty()) return verb;
  for (const LineVerb& below : verb.verbs) {
    if (!below.examples.empty()) verb.examples.push_back(below.examples.front());
  }
  return verb;
}

void arrange(std::vector<LineVerb>& verbs, const std::vector<VerbGroup>& groups) {
  std::vector<LineVerb> arranged;
  for (const VerbGroup& group : groups) {
    for (const std::string& name : group.verbs) {
      const auto found =
          std::ranges::find_if(verbs, [&](const LineVerb& verb) { return verb.path.back() == name; });
      if (found == verbs.end()) continue;
      found->group = group.heading;
      arranged.push_back(std::move(*found));
      verbs.erase(found);
    }
  }
  std::ranges::move(verbs, std::back_inserter(arranged));
  verbs = std::move(arranged);
}

std::string with_names(std::string_view before, const std::vector<std::string>& names) {
  return names.empty() ? "" : std::string(before) + joined(names, ", ");
}

}  // namespace

LineVerb describe_line(const CLI::App& app, const std::string& name, const std::vector<VerbGroup>& groups) {
  std::vector<std::string> path;
  for (const CLI::App* verb = &app; verb->get_parent() != nullptr; verb = verb->get_parent())
    path.insert(path.begin(), verb->get_name());
  path.insert(path.begin(), name);
  LineVerb line = describe(app, std::move(path));
  if (app.get_parent() == nullptr) arrange(line.verbs, groups);
  if (line.text.starts_with(name + ": ")) line.text.erase(0, name.size() + 2);
  return line;
}

std::vector<std::string> option_groups(const LineVerb& verb) {
  std::vector<std::string> groups;
  for (const LineOption& option : verb.options) {
    if (!option.positional && std::ranges::find(groups, option.group) == groups.end())
      groups.push_back(option.group);
  }
  const auto place = [](const std::string& group) {
    return group == kConnection ? 0 : group == kOutput ? 2 : group == kHelp ? 3 : 1;
  };
  std::ranges::stable_sort(groups, {}, place);
  return groups;
}

std::vector<std::string> verb_groups(const LineVerb& verb) {
  std::vector<std::string> groups;
  for (const LineVerb& below : verb.verbs)
    if (groups.empty() || groups.back() != below.group) groups.push_back(below.group);
  return groups;
}

std::string remarks(const LineOption& option) {
  std::string text;
  const auto add = [&text](const std::string& part) {
    if (!part.empty()) text += (text.empty() ? "" : "; ") + part;
  };
  add(range_in_words(option.range));
  if (!option.default_value.empty()) add("default: " + option.default_value);
  if (option.required && !option.positional) add("must be given");
  if (option.repeats) add("may be given several times");
  add(with_names("needs ", option.needs));
  add(with_names("not together with ", option.excludes));
  return text.empty() ? "" : " (" + text + ")";
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
