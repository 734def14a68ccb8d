#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::command {

/// How a child process differs from its parent.
struct ProcessSettings {
  std::vector<std::string> environment{};  ///< NAME=VALUE, in the place of the parent's
  std::string folder{};                    ///< where it starts; empty: here
  std::string error_file{};                ///< takes its standard error; empty: that of the parent
  std::string input_file{};                ///< its standard input; empty: that of the parent
  bool joins_output = false;               ///< its standard output goes to that file, too
  bool own_group = false;                  ///< it gets its signals together with its own children
};

/// A child process with its standard output in a pipe and the standard error of this process. It gets SIGTERM
/// at the end of this process, for whatever reason, and SIGKILL from the destructor if it still runs.
class Process {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  /// The program is looked for in PATH unless its name has a slash. Throws std::system_error if it cannot be
  /// started; one that cannot be executed ends with 127.
  explicit Process(const std::vector<std::string>& arguments, const ProcessSettings& settings = {});
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  /// The next line without its end; nothing at the end of the output or when none comes in time.
  std::optional<std::string> read_line(Deadline deadline);

  /// The result of `parse` for the first line that it understands; nothing if the output ends or the deadline
  /// passes before.
  template <class Parse>
  auto await(Deadline deadline, Parse parse) -> decltype(parse(std::string_view())) {
    while (const std::optional<std::string> line = read_line(deadline)) {
      if (auto found = parse(*line)) return found;
    }
    return std::nullopt;
  }

  /// Sends SIGTERM; has no effect after the end of the child.
  void terminate() noexcept;

  /// Exit code (128 + n after signal n); nothing if it still runs at the deadline.
  std::optional<int> wait(Deadline deadline);

  static Deadline in(std::chrono::milliseconds duration) {
    return std::chrono::steady_clock::now() + duration;
  }

 private:
  void signal(int number) noexcept;

  pid_t pid_ = -1;
  bool own_group_;
  link::FileDescriptor output_;
  std::string buffer_;
  std::optional<int> exit_code_;
};

/// Replaces this process by another program. Throws std::system_error if it cannot.
[[noreturn]] void replace_process(const std::vector<std::string>& arguments);

}  // namespace drivebench::command
