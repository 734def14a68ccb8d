#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

#include "clients/regression/checks/check_reader.hpp"

namespace drivebench::regression {

inline constexpr double kPeriod_s = 0.001;

/// A speed over ticks, and the fault word beside it.
struct Course {
  std::function<double(std::uint64_t)> speed = [](std::uint64_t) { return 0.0; };
  std::function<std::uint64_t(std::uint64_t)> faults = [](std::uint64_t) { return std::uint64_t{0}; };
};

inline RunFacts facts_to(std::uint64_t end_tick) {
  return {.period_s = kPeriod_s, .end_tick = end_tick, .axes = {"one"}, .faults = {{"trip", 256}}};
}

/// The check that this table of a case asks for; its problem instead of a check.
inline std::optional<CheckSpec> spec_of(const std::string& keys, std::string& problem) {
  ProblemList problems;
  const std::string file = "case.toml";
  const auto node = parse_document(keys, file, problems);
  std::optional<CheckSpec> spec;
  if (node) {
    KeyTable table(*node, "check[0]", 1, file, problems);
    spec = read_check(table, std::filesystem::temp_directory_path());
  }
  try {
    problems.throw_if_any();
  } catch (const ConfigError& error) {
    problem = error.what();
    return std::nullopt;
  }
  return spec;
}

inline std::string problem_of_check(const std::string& keys) {
  std::string problem;
  spec_of(keys, problem);
  return problem;
}

/// What the check of these keys finds on a course.
inline Finding found(const std::string& keys, const Course& course, std::uint64_t end_tick = 100) {
  std::string problem;
  std::optional<CheckSpec> spec = spec_of(keys, problem);
  if (!spec) throw std::runtime_error(problem);
  spec->axis = "one";
  const RunFacts facts = facts_to(end_tick);
  const std::unique_ptr<Check> check = spec->kind->make(*spec, facts);
  for (std::uint64_t tick = 0; tick <= end_tick; ++tick) {
    Sample sample;
    sample.tick = tick;
    sample.speed_rad_s = course.speed(tick);
    sample.faults = course.faults(tick);
    check->see(std::span(&sample, 1));
  }
  return check->finish();
}

inline constexpr const char* kSpeed = "signal = \"speed_rad_s\"\n";

inline std::string speed_check(const std::string& kind, const std::string& keys) {
  return "kind = \"" + kind + "\"\n" + kSpeed + keys;
}

}  // namespace drivebench::regression
