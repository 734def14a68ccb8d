#include <algorithm>
#include <string_view>

#include "protocols/pages/completion.hpp"

namespace drivebench::pages {
namespace {

/// The script without its tables. `line` is the path of verbs as ` new motor`, `waiting` an option that waits
/// for its value, `place` the number of arguments that were neither.
constexpr std::string_view kFrame = R"(# Completion of @PROGRAM@ for bash, made by @PROGRAM@ --write-pages.
@OTHER@
@FUNCTION@_words() {  # WORDS: those that continue the word at the cursor, also behind a comma
  local before=''
  if [[ $cur == *,* ]]; then before=${cur%,*},; fi
  mapfile -t COMPREPLY < <(compgen -P "$before" -W "$1" -- "${cur##*,}")
}

@FUNCTION@_paths() {  # -f or -d, WORDS: paths, and words beside them
  mapfile -t COMPREPLY < <(compgen -W "${2-}" -- "$cur"; compgen "$1" -- "$cur")
  compopt -o filenames 2>/dev/null
}

@FUNCTION@() {
  local cur=${COMP_WORDS[COMP_CWORD]} line='' waiting='' place=0 i word
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; i++)); do
    word=${COMP_WORDS[i]}
    if [[ $word == [=:] ]]; then  # bash splits words there
      if [[ -z $waiting ]]; then waiting=$word; fi
    elif [[ -n $waiting ]]; then
      waiting=''
    elif [[ $word == -* ]]; then
      case "$line $word" in
@VALUED@        *) ;;
      esac
    else
      case "$line $word" in
@VERBS@        *) place=$((place + 1)) ;;
      esac
    fi
@PASSES_ON@  done
  if [[ $cur == = ]]; then cur=''; fi

  if [[ -n $waiting ]]; then
    case "$line $waiting" in
@VALUES@        *) ;;
    esac
  elif [[ $cur == -* ]]; then
    case $line in
@OPTIONS@        *) ;;
    esac
  else
    case "$line $place" in
@PLACES@        *) ;;
    esac
  fi
}
complete -F @FUNCTION@ @PROGRAM@
)";

/// Hands the words behind a verb to the completion of the program that gets them.
constexpr std::string_view kPassesOn = R"(    if [[ $line == '@LINE@' ]]; then
      local COMP_WORDS=(@OTHER_PROGRAM@ "${COMP_WORDS[@]:i+1}") COMP_CWORD=$((COMP_CWORD - i))
      if ((COMP_CWORD == 1)) && [[ $cur != -* ]]; then
        @FIRST@
      elif declare -F @OTHER_FUNCTION@ >/dev/null; then
        @OTHER_FUNCTION@
      fi
      return
    fi
)";

void replace(std::string& text, std::string_view mark, std::string_view by) {
  for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos; at += by.size())
    text.replace(at, mark.size(), by);
}

/// The path without the program: ` new motor`.
std::string line_of(const LineVerb& verb) {
  return joined(verb.path, " ").substr(verb.path.front().size());
}

/// The command that completes a value; empty if nothing is known about it.
std::string action(const std::string& function, const std::string& kind,
                   const std::vector<std::string>& words, const CompletionFacts& facts) {
  if (!words.empty()) return function + "_words '" + joined(words, " ") + "'";
  if (names_file(kind)) return function + "_paths -f";
  if (kind == kFolderKind) return function + "_paths -d";
  const auto known = std::ranges::find(facts.names, kind, &KnownNames::kind);
  if (known == facts.names.end()) return "";
  return function + (known->or_file ? "_paths -f '" : "_words '") + joined(known->names, " ") + "'";
}

void add_row(std::string& table, const std::string& pattern, const std::string& command) {
  if (!command.empty()) table += "        '" + pattern + "') " + command + " ;;\n";
}

struct Tables {
  std::string valued, verbs, values, options, places;
};

void add_tables(Tables& tables, const std::string& function, const LineVerb& verb,
                const CompletionFacts& facts) {
  const std::string line = line_of(verb);
  std::vector<std::string> names;
  std::vector<std::string> below;
  std::size_t place = 0;
  for (const LineOption& option : verb.options) {
    const std::string& kind = option.value;
    const std::string command = action(function, kind, option.words, facts);
    if (option.positional) {
      add_row(tables.places, line + " " + std::to_string(place++), command);
      continue;
    }
    std::ranges::copy(option.names, std::back_inserter(names));
    if (option.value.empty()) continue;
    for (const std::string& name : option.names) {
      add_row(tables.valued, line + " " + name, "waiting=$word");
      add_row(tables.values, line + " " + name, command);
    }
  }
  add_row(tables.options, line, function + "_words '" + joined(names, " ") + "'");
  for (const LineVerb& next : verb.verbs) {
    below.push_back(next.path.back());
    add_row(tables.verbs, line_of(next), "line+=\" $word\"");
  }
  if (!below.empty()) add_row(tables.places, line + " 0", function + "_words '" + joined(below, " ") + "'");
}

}  // namespace

std::string completion_function(const std::string& program) {
  std::string name = "_" + program;
  std::ranges::replace(name, '-', '_');
  return name;
}

std::string bash_completion(const LineVerb& line, const CompletionFacts& facts) {
  const std::string function = completion_function(line.path.front());
  Tables tables;
  std::string passes_on;
  for (const LineVerb* verb : all_verbs(line)) {
    add_tables(tables, function, *verb, facts);
    if (!verb->passes_on) continue;
    std::string row(kPassesOn);
    replace(row, "@LINE@", line_of(*verb));
    replace(row, "@FIRST@", action(function, facts.other_first_kind, {}, facts));
    passes_on += row;
  }
  std::string script(kFrame);
  replace(script, "@PASSES_ON@", passes_on);
  replace(script, "@OTHER@\n",
          facts.other_program.empty() ? ""
                                      : "if [[ -r ${BASH_SOURCE[0]%/*}/@OTHER_PROGRAM@ ]]; then . "
                                        "\"${BASH_SOURCE[0]%/*}/@OTHER_PROGRAM@\"; fi\n");
  replace(script, "@OTHER_PROGRAM@", facts.other_program);
  replace(script, "@OTHER_FUNCTION@", completion_function(facts.other_program));
  replace(script, "@FUNCTION@", function);
  replace(script, "@PROGRAM@", line.path.front());
  replace(script, "@VALUED@", tables.valued);
  replace(script, "@VERBS@", tables.verbs);
  replace(script, "@VALUES@", tables.values);
  replace(script, "@OPTIONS@", tables.options);
  replace(script, "@PLACES@", tables.places);
  return script;
}

}  // namespace drivebench::pages
