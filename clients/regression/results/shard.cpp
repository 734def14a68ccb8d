#include "clients/regression/results/shard.hpp"

#include <fmt/core.h>

#include <charconv>
#include <optional>
#include <stdexcept>

#include "protocols/text.hpp"

namespace drivebench::regression {
namespace {

constexpr std::size_t kMostShards = 1'000'000;

std::optional<std::size_t> whole_number(std::string_view text) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::size_t variable(const char* name, const Environment& environment) {
  const char* const text = environment(name);
  if (text == nullptr) throw std::invalid_argument(fmt::format("the variable {} is missing", name));
  const std::optional<std::size_t> number = whole_number(text);
  if (!number)
    throw std::invalid_argument(fmt::format("{} is '{}' but must be a whole number", name, printable(text)));
  return *number;
}

Shard checked(const Shard& shard) {
  if (shard.count < 1 || shard.count > kMostShards || shard.index < 1 || shard.index > shard.count) {
    throw std::invalid_argument(
        fmt::format("shard {} of {} must be one from 1 to the number of shards, at most {}", shard.index,
                    shard.count, kMostShards));
  }
  return shard;
}

Shard shard_of_slurm(const Environment& environment) {
  const std::size_t id = variable("SLURM_ARRAY_TASK_ID", environment);
  const std::size_t first = variable("SLURM_ARRAY_TASK_MIN", environment);
  const std::size_t last = variable("SLURM_ARRAY_TASK_MAX", environment);
  const std::size_t count = variable("SLURM_ARRAY_TASK_COUNT", environment);
  if (last < first || last - first + 1 != count) {
    throw std::invalid_argument(fmt::format(
        "the array of Slurm has {} tasks from {} to {}: only one without gaps has a shard for each", count,
        first, last));
  }
  return checked({.index = id - first + 1, .count = count});
}

}  // namespace

Shard shard_of(std::string_view text, const Environment& environment) {
  if (text == "auto") {
    if (environment("SLURM_ARRAY_TASK_ID") != nullptr) return shard_of_slurm(environment);
    if (environment("CI_NODE_INDEX") != nullptr) {
      return checked(
          {.index = variable("CI_NODE_INDEX", environment), .count = variable("CI_NODE_TOTAL", environment)});
    }
    if (environment("JOB_COMPLETION_INDEX") != nullptr) {
      return checked({.index = variable("JOB_COMPLETION_INDEX", environment) + 1,
                      .count = variable("DRIVEBENCH_SHARDS", environment)});
    }
    throw std::invalid_argument(
        "is 'auto', but the environment has none of SLURM_ARRAY_TASK_ID, CI_NODE_INDEX and "
        "JOB_COMPLETION_INDEX");
  }
  const std::size_t slash = text.find('/');
  const auto index = whole_number(text.substr(0, slash));
  const auto count = slash == std::string_view::npos ? std::nullopt : whole_number(text.substr(slash + 1));
  if (!index || !count)
    throw std::invalid_argument(
        fmt::format("is '{}' but must be 'auto' or I/N, for example 2/4", printable(std::string(text))));
  return checked({.index = *index, .count = *count});
}

}  // namespace drivebench::regression
