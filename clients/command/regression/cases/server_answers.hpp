#pragma once

#include <chrono>
#include <optional>
#include <string_view>
#include <vector>

#include "clients/command/common/programs/process.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "protocols/timing/answer_times.hpp"

namespace drivebench::command {

/// When the commands for each axis came, from the verdict that drivebench-server prints with --json and
/// --measure-answers; nothing for any other line.
std::optional<std::vector<AnswerTimes>> parse_answers(std::string_view line);

/// A server that repeats or replays a long recording says nothing before its end.
constexpr auto kRepetitionPatience = std::chrono::hours(24);

/// As Process::await(), but the user may interrupt it: throws then, see end_if_interrupted().
template <class Parse>
auto await_answer(Process& server, std::chrono::milliseconds patience, Parse parse)
    -> decltype(parse(std::string_view())) {
  constexpr std::chrono::milliseconds kSlice(100);
  const Process::Deadline deadline = Process::in(patience);
  while (std::chrono::steady_clock::now() < deadline) {
    if (auto found = server.await(Process::in(kSlice), parse)) return found;
    const bool has_ended = server.wait(Process::in(std::chrono::milliseconds(0))).has_value();
    end_if_interrupted();
    if (has_ended) break;
  }
  return std::nullopt;
}

}  // namespace drivebench::command
