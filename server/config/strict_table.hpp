#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "protocols/document.hpp"

namespace drivebench {

/// Reads a table key by key. A value of the wrong type, outside its limits or not finite is a problem, and so
/// is every unknown key. Each function returns nothing for a key that is absent or wrong.
class StrictTable {
 public:
  /// A null table reads as an empty one at `line`.
  StrictTable(const ConfigNode* table, std::string path, int line, const std::string& file,
              ProblemList& problems);

  std::optional<bool> boolean(std::string_view key);
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t minimum, std::int64_t maximum);
  /// Like integer(), also in hexadecimal.
  std::optional<std::int64_t> hexadecimal_integer(std::string_view key, std::int64_t minimum,
                                                  std::int64_t maximum);
  std::optional<double> real(std::string_view key);
  std::optional<double> real(std::string_view key, double minimum, double maximum);
  /// Plain text, not empty, of at most `most` bytes.
  std::optional<std::string> text(std::string_view key, std::size_t most);
  /// Letters, digits, '.', '_' and '-', at most 64 of them.
  std::optional<std::string> identifier(std::string_view key);
  /// An address, see is_address().
  std::optional<std::string> address(std::string_view key);
  /// The index of one of the words.
  std::optional<std::size_t> choice(std::string_view key, std::span<const std::string_view> words);

  /// A value of any kind; null if absent.
  const ConfigNode* node(std::string_view key) { return take(key); }
  StrictTable table(std::string_view key);
  std::vector<StrictTable> tables(std::string_view key, std::size_t most);

  /// Reports the key if it is absent.
  void require(std::string_view key);
  /// Reports every key that no call has named. To be called last.
  void finish();

  bool has(std::string_view key) const { return find(key) != nullptr; }
  bool exists() const { return table_ != nullptr; }
  int line() const { return line_; }
  int line_of(std::string_view key) const;
  /// Adds a problem with this key, at its line.
  void report(std::string_view key, std::string rule) { report_at(line_of(key), key, std::move(rule)); }
  /// The problem that report() adds.
  ConfigProblem problem(std::string_view key, std::string rule) const {
    return {*file_, line_of(key), path_of(key), std::move(rule)};
  }
  /// report() at another line, for an element of the value.
  void report_at(int line, std::string_view key, std::string rule);

 private:
  const ConfigNode* find(std::string_view key) const;
  /// The node with this key; the key then counts as known.
  const ConfigNode* take(std::string_view key);
  template <class T>
  const T* scalar(std::string_view key, std::string_view expected);
  std::string path_of(std::string_view key) const;

  const ConfigNode* table_;
  std::string path_;
  int line_;
  const std::string* file_;
  ProblemList* problems_;
  std::vector<std::string> known_;
};

}  // namespace drivebench
