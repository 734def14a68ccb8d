#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "protocols/timing/answer_times.hpp"

namespace drivebench::command {

/// When the commands for each axis came, from the verdict that drivebench-server prints with --json and
/// --measure-answers; nothing for any other line.
std::optional<std::vector<AnswerTimes>> parse_answers(std::string_view line);

}  // namespace drivebench::command
