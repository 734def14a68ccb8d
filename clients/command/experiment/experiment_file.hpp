#pragma once

#include <bench.pb.h>

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

/// Experiments as TOML files. The keys are the fields of RunExperiment in bench.proto, read from its
/// description, so that there is no second list of them.
namespace drivebench::command {

struct ExperimentFile {
  v1::RunExperiment request;  ///< without owner, request_key, axis and the numbers of tables
  std::string axis = "0";     ///< number or name
};

/// Parses an experiment file. Throws ConfigError with all problems and their lines.
ExperimentFile parse_experiment(std::string_view text, const std::string& name);
ExperimentFile load_experiment(const std::filesystem::path& file);

/// The file that parse_experiment() reads as this experiment, with `comment` above it as lines of comment.
std::string to_toml(const ExperimentFile& file, std::string_view comment);

/// Calls `take` with the rows of a CSV file, time and value, in pieces that fit into a request. Throws
/// ConfigError with the line of the first wrong row.
void read_table(const std::filesystem::path& file, const std::function<void(v1::UploadTable&)>& take);

/// The word for a state in files and printouts.
std::string word_of(v1::ExperimentState state);

}  // namespace drivebench::command
