#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace drivebench::command {

/// The server's information about an experiment.
nlohmann::ordered_json json_of(const v1::ExperimentInfo& info);
/// The information as a line; `resumed` is the number of reconnections.
std::string experiment_json(const v1::ExperimentInfo& info, std::string_view out_file, std::uint64_t resumed);
std::string experiments_json(const v1::ExperimentList& list);

}  // namespace drivebench::command
