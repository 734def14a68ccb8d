#pragma once

#include <string>

namespace drivebench::command {

/// Replaces this process by drivebench-server, which replays the recording.
struct ReplayOptions {
  std::string recording{};
  bool json = false;
};
int run_replay(const ReplayOptions& options);

}  // namespace drivebench::command
