#pragma once

#include <string>

namespace drivebench {

/// `--replay FILE`: re-simulates a recording with the later files of its series and prints the result.
/// Returns 0: equal, 1: different, 2: unusable.
int replay_command(const std::string& file, bool json);

}  // namespace drivebench
