#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {

std::string describe_json(const v1::Welcome& welcome);
std::string status_json(const v1::Status& status, const v1::BenchDescription& bench);
/// One line: bench, axis, dropped, the time of the tick and the chosen signals.
std::string sample_json(const Sample& sample, const v1::BenchDescription& bench, std::uint32_t axis,
                        std::uint64_t dropped, const std::vector<const Signal*>& signals);
/// {axis, name: "clear", cleared: [...], tick}
std::string clear_json(const v1::BenchDescription& bench, std::uint32_t axis, std::uint64_t cleared,
                       std::uint64_t tick);

/// {done: "saved" or "restored" or "reset to", tick, file if there is one}
std::string state_json(std::string_view done, std::uint64_t tick, const std::string& file);

/// An accepted fault, parameter or bump, with its tick: {axis, name, value, tick}
std::string change_json(std::uint32_t axis, std::string_view name, double value, std::uint64_t tick);

}  // namespace drivebench::command
