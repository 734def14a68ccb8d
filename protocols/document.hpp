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

/// One thing wrong with a configuration, with the place it was found at.
struct ConfigProblem {
  std::string file;
  int line = 0;
  std::string key;  ///< full path of the key, for example "axis.machine.rotor_resistance_ohm"
  std::string rule;
};

/// All that is wrong with a configuration, at once; what() is the list as a user reads it, "file:line: key
/// rule" lines.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<ConfigProblem> problems);
  const std::vector<ConfigProblem>& problems() const noexcept { return problems_; }

 private:
  std::vector<ConfigProblem> problems_;
};

/// Collects problems; beyond a hundred it only counts, so that a file of garbage costs no time.
class ProblemList {
 public:
  void add(const std::string& file, int line, std::string key, std::string rule);
  bool full() const noexcept { return problems_.size() >= kMost; }
  /// Throws ConfigError, sorted by file and line, if there are any.
  void throw_if_any();

 private:
  static constexpr std::size_t kMost = 100;
  std::vector<ConfigProblem> problems_;
  std::size_t dropped_ = 0;
};

inline constexpr std::size_t kMaxConfigBytes = 262'144;
/// Of the text in a recording, which holds what stood in CSV files.
inline constexpr std::size_t kMaxRecordedConfigBytes = 8'388'608;

/// A value of a TOML document with its place: keeps the TOML library out of all files but one.
struct ConfigNode {
  enum class Kind { kTable, kArray, kScalar };
  /// What a scalar that configurations have no use for is called, for example "a date".
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

/// The document, or nothing, with the problem added. Bounds size, line length and nesting, so that no text
/// can cost more than some milliseconds or the stack.
std::optional<ConfigNode> parse_document(std::string_view text, const std::string& file,
                                         ProblemList& problems, std::size_t limit = kMaxConfigBytes);

/// A whole regular file of at most `limit` bytes, or why it cannot be had, as the end of "the file ...".
struct FileText {
  std::string text;
  std::string why_not;           ///< empty: text is the file
  bool others_may_read = false;  ///< group or others
};
FileText read_file(const std::filesystem::path& file, std::size_t limit);

/// The text as UTF-8, at most so many bytes of it and no character by half; '?' for a byte that belongs to
/// none. A string of protobuf that is anything else makes its message one that nobody can read.
std::string utf8(std::string_view text, std::size_t most = std::string_view::npos);

/// The text fit for one line of a terminal: UTF-8 without control characters, cut after 160 bytes.
std::string printable(std::string_view text);

/// As hexadecimal numbers are written: 0x1a.
std::string hexadecimal(std::int64_t value);

/// The shortest decimal text that reads back as the same double.
std::string shortest(double value);

}  // namespace drivebench
