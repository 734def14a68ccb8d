#pragma once

#include <string>
#include <vector>

#include "protocols/pages/line_description.hpp"

namespace drivebench::pages {

/// The names that a value of a kind has, `BENCH` for example.
struct KnownNames {
  std::string kind{};
  std::vector<std::string> names{};
  bool or_file = false;
};

/// What completion knows beyond the command line.
struct CompletionFacts {
  std::vector<KnownNames> names{};
  std::string other_program{};     ///< which gets the arguments of verbs that pass them on
  std::string other_first_kind{};  ///< the kind of its first argument there
};

/// A script that bash sources: it completes verbs, options and their values.
std::string bash_completion(const LineVerb& line, const CompletionFacts& facts);

/// The function file `_NAME` that zsh loads.
std::string zsh_completion(const LineVerb& line, const CompletionFacts& facts);

/// The name of the function of a program, `_drivebench_server`.
std::string completion_function(const std::string& program);

inline bool names_file(const std::string& kind) {
  return kind.starts_with("FILE");
}
inline constexpr const char* kFolderKind = "FOLDER";

}  // namespace drivebench::pages
