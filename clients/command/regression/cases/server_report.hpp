#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/common/programs/process.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "protocols/timing/answer_times.hpp"

namespace drivebench::command {

/// A message to the device under test, as the server reports it.
struct SentMessage {
  std::uint64_t tick = 0;  ///< whose sample it preceded
  std::string text{};
  std::string problem{};  ///< why it did not arrive; empty: nothing is known against it
};

/// What the verdict of a server has beside the run.
struct ServerReport {
  std::vector<AnswerTimes> answers{};  ///< when the commands for each axis came; empty: it was not measured
  std::vector<SentMessage> messages{};
};

/// Reads the verdict that drivebench-server prints with --json; nothing for any other line.
std::optional<ServerReport> parse_report(std::string_view line);

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
