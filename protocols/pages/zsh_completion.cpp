#include <algorithm>
#include <string_view>

#include "protocols/pages/completion.hpp"

namespace drivebench::pages {
namespace {

/// In single quotes, with a backslash before the signs that _arguments reads.
std::string quoted(std::string_view text, std::string_view special) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
      continue;
    }
    if (c == '\\' || special.find(c) != std::string_view::npos) out += '\\';
    out += c;
  }
  return out;
}

/// What completes a value; a blank: nothing is known about it.
std::string action(const std::string& kind, const std::vector<std::string>& words, bool list,
                   const CompletionFacts& facts) {
  const auto known = std::ranges::find(facts.names, kind, &KnownNames::kind);
  const std::vector<std::string>& names = known == facts.names.end() ? words : known->names;
  if (!names.empty() && list) return "_values -s , " + kind + " " + joined(names, " ");
  if (known != facts.names.end() && known->or_file) {
    return "_alternative \"names:" + kind + ":(" + joined(names, " ") + ")\" \"files:FILE:_files\"";
  }
  if (!names.empty()) return "(" + joined(names, " ") + ")";
  if (names_file(kind)) return "_files";
  return kind == kFolderKind ? "_files -/" : " ";
}

std::string action(const LineOption& option, const CompletionFacts& facts) {
  const std::string& kind = option.value;
  const std::string found = action(kind, option.words, option.list, facts);
  const bool command = found.starts_with("_alternative");
  return ":" + quoted(kind, ":") + ":" + (command ? "{" + found + "}" : found);
}

void add_option(std::string& script, const LineOption& option, const CompletionFacts& facts) {
  for (const std::string& name : option.names) {
    script += std::string(" \\\n    '") + (option.value.empty() ? "" : "*") + name +
              (option.value.empty()     ? ""
               : name.starts_with("--") ? "="
                                        : "+");
    script +=
        "[" + quoted(option.text, "[]") + "]" + (option.value.empty() ? "" : action(option, facts)) + "'";
  }
}

std::string function_of(const LineVerb& verb) {
  return completion_function(joined(verb.path, "_"));
}

/// A verb with verbs below it: their names, then the function of the one that was named.
void add_below(std::string& script, const LineVerb& verb) {
  script +=
      " \\\n    '1:VERB:->verb' '*::ARGUMENT:->rest' && return\n  case $state in\n    verb)\n      local -a "
      "verbs";
  for (const std::string& group : verb_groups(verb)) {
    script += "\n      verbs=(";
    for (const LineVerb& below : verb.verbs)
      if (below.group == group)
        script += "\n        '" + quoted(below.path.back(), ":") + ":" + quoted(below.text, "") + "'";
    script += ")\n      _describe -V '" + quoted(group.empty() ? "verb" : group, "") + "' verbs";
  }
  script += " ;;\n    rest)\n      case $words[1] in\n";
  for (const LineVerb& below : verb.verbs)
    script += "        " + below.path.back() + ") " + function_of(below) + " ;;\n";
  script += "      esac ;;\n  esac\n";
}

/// A verb whose arguments are those of another program.
void add_passing_on(std::string& script, const CompletionFacts& facts) {
  script +=
      "  words[1]=" + facts.other_program + "\n  if ((CURRENT == 2)) && [[ $words[2] != -* ]]; then\n    " +
      action(facts.other_first_kind, {}, false, facts) + "\n  else\n    _" + facts.other_program + "\n  fi\n";
}

void add_function(std::string& script, const LineVerb& verb, const CompletionFacts& facts) {
  script += "\n" + function_of(verb) + "() {\n";
  if (verb.passes_on) {
    add_passing_on(script, facts);
  } else {
    script += "  local curcontext=$curcontext state line\n  typeset -A opt_args\n  _arguments -C";
    std::size_t place = 0;
    for (const LineOption& option : verb.options) {
      if (option.positional) {
        script += " \\\n    '" + std::to_string(++place) + (option.required ? "" : ":") +
                  action(option, facts) + "'";
      } else {
        add_option(script, option, facts);
      }
    }
    if (verb.verbs.empty()) {
      script += "\n";
    } else {
      add_below(script, verb);
    }
  }
  script += "}\n";
}

}  // namespace

std::string zsh_completion(const LineVerb& line, const CompletionFacts& facts) {
  const std::string& program = line.path.front();
  std::string script =
      "#compdef " + program + "\n# Completion for zsh, made by " + program + " --write-pages.\n";
  for (const LineVerb* verb : all_verbs(line))
    add_function(script, *verb, facts);
  return script + "\n" + completion_function(program) + " \"$@\"\n";
}

}  // namespace drivebench::pages
