#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/link/common/file_descriptor.hpp"

namespace drivebench::command {

/// A program run as a child, its standard output in a pipe, its standard error ours. It gets SIGTERM when
/// this process ends, however that happens, and SIGKILL when this object goes while it still runs.
class Process {
 public:
  using Deadline = std::chrono::steady_clock::time_point;

  /// Throws std::system_error if it cannot be started.
  explicit Process(const std::vector<std::string>& arguments);
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  /// The next line without its end; nothing at the end of the output or when none comes in time.
  std::optional<std::string> read_line(Deadline deadline);

  /// The first line that `parse` understands, as it understood it; nothing if the output ends or the deadline
  /// passes before.
  template <class Parse>
  auto await(Deadline deadline, Parse parse) -> decltype(parse(std::string_view())) {
    while (const std::optional<std::string> line = read_line(deadline)) {
      if (auto found = parse(*line)) return found;
    }
    return std::nullopt;
  }

  /// SIGTERM; harmless when it has ended.
  void terminate() noexcept;

  /// Exit code (128 + n after signal n); nothing if it still runs at the deadline.
  std::optional<int> wait(Deadline deadline);

  static Deadline in(std::chrono::milliseconds duration) {
    return std::chrono::steady_clock::now() + duration;
  }

 private:
  pid_t pid_ = -1;
  link::FileDescriptor output_;
  std::string buffer_;
  std::optional<int> exit_code_;
};

/// Replaces this process by another program. Throws std::system_error if it cannot.
[[noreturn]] void replace_process(const std::vector<std::string>& arguments);

}  // namespace drivebench::command
