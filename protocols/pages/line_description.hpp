#pragma once

#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming): as CLI11 names it
class App;
}

namespace drivebench::pages {

// Headings of options that many verbs have.
inline constexpr const char* kConnection = "Connection";
inline constexpr const char* kWhat = "What to do";
inline constexpr const char* kLimits = "Limits";
inline constexpr const char* kOutput = "Output";
inline constexpr const char* kHelp = "Help";

/// An option or a positional of a command line. Man pages, completions and --help have the same texts: those
/// that the program gave CLI11.
struct LineOption {
  std::vector<std::string> names{};  ///< `-h`, `--help`; of a positional its only name, `FILE`
  std::string text{};
  std::string group{};
  std::string value{};               ///< the kind of its value, `FILE` or `NUMBER`; empty: a flag
  std::vector<std::string> words{};  ///< the only values there are, if they are listed
  std::string range{};               ///< `1 - 127`, the smallest and the largest number; may be empty
  std::string default_value{};
  std::vector<std::string> needs{};
  std::vector<std::string> excludes{};
  bool positional = false;
  bool required = false;
  bool list = false;     ///< values with commas between them
  bool repeats = false;  ///< each time it is given adds a value
};

/// A verb of a command line, or the whole of it.
struct LineVerb {
  std::vector<std::string> path{};  ///< `drivebench`, `new`, `motor`
  std::string text{};
  std::string group{};                  ///< the heading that it stands under in the list of verbs
  std::vector<std::string> examples{};  ///< of a verb with verbs below it the first of each, if it has none
  std::vector<std::string> notes{};
  std::vector<std::string> exit_codes{};  ///< `Exit codes: 0 ok, ...`
  bool passes_on = false;                 ///< its arguments are those of another program
  std::vector<LineOption> options{};
  std::vector<LineVerb> verbs{};
};

/// Verbs that stand together in the list of a program.
struct VerbGroup {
  std::string heading{};
  std::vector<std::string> verbs{};
};

/// What CLI11 was told about `app`, which is a verb of the program `name` or the whole of it. The verbs of
/// the program come in the order of `groups`; one without a group comes last.
LineVerb describe_line(const CLI::App& app, const std::string& name,
                       const std::vector<VerbGroup>& groups = {});

/// All verbs below `verb`, and first itself.
std::vector<const LineVerb*> all_verbs(const LineVerb& verb);

/// The headings of the verb's options in the order of their appearance, but kConnection first, and kOutput
/// and kHelp last.
std::vector<std::string> option_groups(const LineVerb& verb);

/// The headings of the verbs below.
std::vector<std::string> verb_groups(const LineVerb& verb);

/// What the text of an option does not say, in brackets: its bounds, its default, what it goes with. Empty if
/// that is nothing.
std::string remarks(const LineOption& option);

/// The path with `between` between its words.
std::string joined(const std::vector<std::string>& path, const std::string& between);

}  // namespace drivebench::pages
