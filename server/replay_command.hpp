#pragma once

#include <string>

namespace drivebench {

/// `--replay FILE`: re-simulates a recording, with the files that follow it, and prints what came out. 0:
/// equal, 1: different, 2: unusable.
int replay_command(const std::string& file, bool json);

}  // namespace drivebench
