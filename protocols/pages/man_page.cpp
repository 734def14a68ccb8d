#include "protocols/pages/man_page.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <utility>

namespace drivebench::pages {
namespace {

/// What troff takes for an escape or turns into a typographic sign, and how it prints it as it is.
constexpr auto kSigns = std::to_array<std::pair<char, std::string_view>>({{'\\', "\\(rs"},
                                                                          {'-', "\\-"},
                                                                          {'\'', "\\(aq"},
                                                                          {'"', "\\(dq"},
                                                                          {'`', "\\(ga"},
                                                                          {'^', "\\(ha"},
                                                                          {'~', "\\(ti"}});

std::string roff(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '.' && (out.empty() || out.back() == '\n')) out += "\\&";  // no request
    const auto sign = std::ranges::find(kSigns, c, &std::pair<char, std::string_view>::first);
    if (sign == kSigns.end()) {
      out += c;
    } else {
      out += sign->second;
    }
  }
  return out;
}

std::string bold(std::string_view text) {
  return "\\fB" + roff(text) + "\\fR";
}

std::string italic(std::string_view text) {
  return "\\fI" + roff(text) + "\\fR";
}

void add_section(std::string& page, std::string_view title) {
  page += ".SH ";
  page += title;
  page += "\n";
}

/// `FILE`, `SIGNAL,...`, `csv|candump`.
std::string value_of(const LineOption& option) {
  if (option.list) return italic(option.value) + ",...";
  if (option.words.empty()) return italic(option.value);
  std::string words;
  for (const std::string& word : option.words)
    words += (words.empty() ? "" : "|") + bold(word);
  return words;
}

std::string heading(const LineOption& option) {
  if (option.positional) return italic(option.names.front());
  std::string names;
  for (const std::string& name : option.names)
    names += (names.empty() ? "" : ", ") + bold(name);
  return option.value.empty() ? names : names + " " + value_of(option);
}

void add_option(std::string& page, const LineOption& option) {
  const std::string text = option.text + remarks(option);
  page += ".TP\n" + heading(option) + "\n" + (text.empty() ? "\\&" : roff(text)) + "\n";
}

void add_options(std::string& page, const LineVerb& verb) {
  add_section(page, "OPTIONS");
  for (const std::string& group : option_groups(verb)) {
    page += ".SS " + roff(group) + "\n";
    for (const LineOption& option : verb.options)
      if (!option.positional && option.group == group) add_option(page, option);
  }
}

void add_synopsis(std::string& page, const LineVerb& verb) {
  add_section(page, "SYNOPSIS");
  page += bold(joined(verb.path, " "));
  if (verb.passes_on) {
    page += " [" + italic("ARGUMENT") + " ...]";
  } else {
    page += " [" + italic("OPTION") + " ...]";
  }
  for (const LineOption& option : verb.options) {
    if (option.positional) {
      const std::string name = italic(option.names.front());
      page += option.required ? " " + name : " [" + name + "]";
    } else if (option.required) {
      page += " " + heading(option);
    }
  }
  if (!verb.verbs.empty()) page += " " + italic("VERB") + " [" + italic("ARGUMENT") + " ...]";
  page += "\n";
}

std::string upper(std::string text) {
  for (char& c : text)
    c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

std::string sentence(const std::string& text) {
  return upper(text.substr(0, 1)) + text.substr(std::min<std::size_t>(text.size(), 1)) + ".";
}

void add_verbs(std::string& page, const LineVerb& verb, const ManHead& head) {
  add_section(page, "VERBS");
  for (const std::string& group : verb_groups(verb)) {
    if (!group.empty()) page += ".SS " + roff(group) + "\n";
    for (const LineVerb& below : verb.verbs) {
      if (below.group != group) continue;
      page += ".TP\n" + bold(joined(below.path, "-")) + "(" + head.section + ")\n";
      page += roff(below.text) + "\n";
    }
  }
}

/// What stands below the options of --help.
void add_footer(std::string& page, const LineVerb& verb) {
  const auto add = [&page](std::string_view title, const std::vector<std::string>& lines, bool as_they_are) {
    if (lines.empty()) return;
    add_section(page, title);
    if (as_they_are) page += ".nf\n";
    for (const std::string& line : lines)
      page += roff(line) + "\n";
    if (as_they_are) page += ".fi\n";
  };
  add("NOTES", verb.notes, false);
  add("EXAMPLES", verb.examples, true);
  add("EXIT STATUS", verb.exit_codes, false);
}

void add_see_also(std::string& page, const LineVerb& verb, const ManHead& head) {
  std::vector<std::string> others = head.see_also;
  if (verb.path.size() > 1) {
    const std::vector<std::string> above(verb.path.begin(), verb.path.end() - 1);
    others.insert(others.begin(), joined(above, "-") + "(" + head.section + ")");
  }
  if (others.empty()) return;
  add_section(page, "SEE ALSO");
  for (const std::string& other : others) {
    const std::size_t open = other.find('(');
    page += bold(other.substr(0, open)) + other.substr(open) + (&other == &others.back() ? "\n" : ",\n");
  }
}

}  // namespace

std::string man_page(const LineVerb& verb, const ManHead& head) {
  const std::string title = joined(verb.path, "-");
  std::string page = ".\\\" Made by " + verb.path.front() + " --write-pages from the texts of --help.\n";
  std::string text = verb.text;
  if (text.ends_with('.')) text.pop_back();
  page += ".TH " + roff(upper(title)) + " " + head.section + " " + head.date + " \"" + roff(head.version) +
          "\"\n";
  page += ".nh\n.ad l\n";  // names of options are not hyphenated
  add_section(page, "NAME");
  page += roff(title) + " \\- " + roff(text) + "\n";
  add_synopsis(page, verb);
  add_section(page, "DESCRIPTION");
  page += roff(sentence(text)) + "\n";
  if (!verb.verbs.empty()) add_verbs(page, verb, head);
  if (std::ranges::any_of(verb.options, &LineOption::positional)) {
    add_section(page, "ARGUMENTS");
    for (const LineOption& option : verb.options)
      if (option.positional) add_option(page, option);
  }
  add_options(page, verb);
  add_footer(page, verb);
  add_see_also(page, verb, head);
  return page;
}

}  // namespace drivebench::pages
