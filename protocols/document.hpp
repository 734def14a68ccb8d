#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace drivebench {

/// One problem of a configuration, with its place.
struct ConfigProblem {
  std::string file;
  int line = 0;
  std::string key;  ///< full path of the key, for example "axis.machine.rotor_resistance_ohm"
  std::string rule;
};

/// All problems of a configuration at once; what() lists them for the user, one "file:line: key rule" line
/// for each.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<ConfigProblem> problems);
  const std::vector<ConfigProblem>& problems() const noexcept { return problems_; }

 private:
  std::vector<ConfigProblem> problems_;
};

/// Collects problems. Beyond a hundred it only counts them, so that a file of garbage costs no time.
class ProblemList {
 public:
  static constexpr std::size_t kMost = 100;

  void add(const std::string& file, int line, std::string key, std::string rule);
  void add(const ProblemList& others);
  std::size_t count() const noexcept { return problems_.size(); }
  bool full() const noexcept { return problems_.size() >= kMost; }
  /// Throws ConfigError, sorted by file and line, if there are any.
  void throw_if_any();

 private:
  std::vector<ConfigProblem> problems_;
  std::size_t dropped_ = 0;
};

inline constexpr std::size_t kMaxConfigBytes = 262'144;
/// The limit for the text in a recording, which includes the points of CSV files.
inline constexpr std::size_t kMaxRecordedConfigBytes = 8'388'608;

/// A value of a TOML document with its place. Only document.cpp includes the TOML library.
struct ConfigNode {
  enum class Kind { kTable, kArray, kScalar };
  /// A scalar of a type that no configuration uses: its description for a message, for example "a date or
  /// time".
  struct Other {
    std::string_view what;
  };
  /// An integer written 0x...
  struct Hexadecimal {
    std::int64_t value;
  };

  std::string key;  ///< empty within an array
  int line = 0;
  Kind kind = Kind::kTable;
  std::variant<Other, std::string, std::int64_t, double, bool, Hexadecimal> scalar;
  std::vector<ConfigNode> children;
};

/// Parses a document; on failure adds the problem and returns nothing. Limits on size, line length and
/// nesting bound the time to some milliseconds, and the stack.
std::optional<ConfigNode> parse_document(std::string_view text, const std::string& file,
                                         ProblemList& problems, std::size_t limit = kMaxConfigBytes);

/// The text of a regular file of at most `limit` bytes, or the reason why it cannot be read: the predicate of
/// "the file ...".
struct FileText {
  std::string text;
  std::string why_not;           ///< empty: text is the file
  bool others_may_read = false;  ///< group or others
};
FileText read_file(const std::filesystem::path& file, std::size_t limit);

}  // namespace drivebench
