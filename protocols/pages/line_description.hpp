#pragma once

#include <string>
#include <vector>

namespace CLI {  // NOLINT(readability-identifier-naming): as CLI11 names it
class App;
}

namespace drivebench::pages {

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
  bool list = false;  ///< values with commas between them
};

/// A verb of a command line, or the whole of it.
struct LineVerb {
  std::vector<std::string> path{};  ///< `drivebench`, `new`, `motor`
  std::string text{};
  std::string footer{};
  bool passes_on = false;  ///< its arguments are those of another program
  std::vector<LineOption> options{};
  std::vector<LineVerb> verbs{};
};

/// What CLI11 was told about the program `name`.
LineVerb describe_line(const CLI::App& app, const std::string& name);

/// All verbs below `verb`, and first itself.
std::vector<const LineVerb*> all_verbs(const LineVerb& verb);

/// The path with `between` between its words.
std::string joined(const std::vector<std::string>& path, const std::string& between);

}  // namespace drivebench::pages
