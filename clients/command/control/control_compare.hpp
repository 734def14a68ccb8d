#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "clients/control/gains/gains.hpp"

namespace drivebench::command {

/// Feeds the preset's controller with the samples of a recording, without a bench.
struct CompareOptions {
  std::string recording{};
  bool json = false;
  std::string preset = "book/8.2.2";
  std::vector<control::Gain> overrides{};
  std::string axis{};  ///< name; empty or "0": the first in the file
  std::optional<std::uint64_t>
      from_tick{};      ///< start of the run; default: the first command with a set-point
  std::string other{};  ///< recording of the reference's own run; empty: none
  /// [V] or [A]; the exit code is 1 if a command differs by more or some of the run is missing.
  std::optional<double> threshold{};
};
int run_compare(const CompareOptions& options);

/// The difference of two series.
struct Difference {
  double largest = 0.0;
  std::uint64_t largest_tick = 0;
  double sum_of_squares = 0.0;
  std::int64_t count = 0;
  std::optional<std::uint64_t> first_tick_beyond;  ///< the threshold

  void add(std::uint64_t tick, double difference, double threshold) noexcept;
  double rms() const noexcept;
};

/// A recorded run and the reference controller fed with the same samples.
struct Comparison {
  std::string recording;
  std::string axis;
  std::string preset;
  std::string unit;  ///< of the commands
  double threshold = 0.0;
  std::uint64_t first_tick = 0;
  std::int64_t samples = 0;
  bool whole = false;   ///< the recording holds the run to its end
  Difference commands;  ///< recorded - reference, all terminals
  std::vector<std::pair<std::string, Difference>> terminals;
  Difference tracking_rad;  ///< reference of the trajectory - recorded angle
  double final_error_rad = 0.0;
  double counts_per_rad = 0.0;  ///< 0: unknown
  std::string other;            ///< recording of the reference's own run; empty: none
  Difference other_commands;    ///< recorded - those of that run, at the same time
  Difference other_angle_rad;
};

}  // namespace drivebench::command
