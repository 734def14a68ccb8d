#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/document.hpp"

namespace drivebench::regression {

using Kind = ConfigNode::Kind;

/// The child with this key; null: there is none.
const ConfigNode* find_child(const ConfigNode& table, std::string_view key) noexcept;

/// A scalar that is a finite number.
std::optional<double> number_in(const ConfigNode& node) noexcept;

inline constexpr double kAnyNumber = std::numeric_limits<double>::max();

/// Reads a table of a case file key by key. A missing, wrong or unknown key is a problem with file, line and
/// path; every function then returns nothing, so that all problems of a file are told at once.
class KeyTable {
 public:
  /// `file` and `problems` must outlive the table. Where a node has no line of its own, `line` is told.
  KeyTable(const ConfigNode& node, std::string path, int line, const std::string& file,
           ProblemList& problems);

  bool has(std::string_view key) const noexcept { return find_child(*node_, key) != nullptr; }
  int line() const noexcept { return line_; }

  /// The value as it stands; null: the key is absent.
  const ConfigNode* node(std::string_view key);
  std::optional<std::string> text(std::string_view key);
  std::optional<double> number(std::string_view key, double minimum = -kAnyNumber,
                               double maximum = kAnyNumber);
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t minimum, std::int64_t maximum);
  std::vector<std::string> texts(std::string_view key);
  /// Absent: nothing.
  std::optional<KeyTable> table(std::string_view key);
  std::vector<KeyTable> tables(std::string_view key);

  void require(std::string_view key);
  /// Refuses every key that no call has named, with the nearest one that was. The last call.
  void finish();

  void report(std::string_view key, std::string rule);

 private:
  std::string path_of(std::string_view key) const;
  int line_of(std::string_view key) const noexcept;

  const ConfigNode* node_;
  std::string path_;
  int line_;
  const std::string* file_;
  ProblemList* problems_;
  std::vector<std::string> known_;
};

/// The value for a sentence: `"text"`, `12`, `a table`.
std::string described(const ConfigNode& node);

}  // namespace drivebench::regression
