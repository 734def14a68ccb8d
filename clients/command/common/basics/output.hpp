#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include "clients/command/common/basics/errors.hpp"

namespace drivebench::command {

/// Throws UsageError if the name promises a format that is not written.
inline void check_suffix(const std::string& path, std::initializer_list<std::string_view> right) {
  const std::string suffix = std::filesystem::path(path).extension().string();
  if (suffix.empty() || std::ranges::find(right, suffix) != right.end()) return;
  throw UsageError(fmt::format("cannot write {}: the name must end with {}", path, fmt::join(right, ", ")));
}

/// Standard output or a file. Throws UsageError if the file cannot be created, std::runtime_error if a write
/// fails.
class Output {
 public:
  /// Standard output if the path is empty.
  explicit Output(const std::string& path)
      : path_(path.empty() ? "standard output" : path),
        file_(path.empty() ? stdout : std::fopen(path.c_str(), "wbe"),
              path.empty() ? &keep_open : &std::fclose) {
    if (!file_) throw UsageError(fmt::format("cannot write {}: {}", path_, reason()));
  }

  void write(std::string_view text) {
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) fail();
  }
  void flush() {
    if (std::fflush(file_.get()) != 0) fail();
  }

 private:
  static int keep_open(std::FILE*) { return 0; }
  static std::string reason() { return std::generic_category().message(errno); }
  [[noreturn]] void fail() { throw std::runtime_error(fmt::format("cannot write {}: {}", path_, reason())); }

  std::string path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

}  // namespace drivebench::command
