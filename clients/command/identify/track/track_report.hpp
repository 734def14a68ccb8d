#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/identification/motors/induction/resistance_tracking.hpp"

namespace drivebench::command {

/// What the bench says about the motor.
struct TrackTruth {
  double time_s = 0.0;
  double stator_resistance_ohm = 0.0;
  double rotor_time_constant_s = 0.0;
};

/// An estimate, at the middle of its window.
struct TrackRow {
  double time_s = 0.0;
  identification::ResistanceEstimate estimate;
  std::optional<TrackTruth> truth;
};

/// Prints the rows as they come, and keeps them for the picture.
class TrackReport {
 public:
  explicit TrackReport(bool json) : json_(json) {}

  void heading(const std::string& source, const identification::KnownInductances& known,
               double window_s) const;
  void gap(std::uint64_t missing, double time_s);
  void add(const TrackRow& row);

  std::size_t rows() const noexcept { return rows_.size(); }
  std::size_t gaps() const noexcept { return gaps_; }
  /// Whether a resistance or time constant was stated at all.
  bool has_stated() const noexcept { return stated_; }
  std::string plot(const std::string& title) const;

 private:
  bool json_;
  bool stated_ = false;
  std::size_t gaps_ = 0;
  std::vector<TrackRow> rows_;
};

/// One line each; unseen values are null.
std::string track_row_json(const TrackRow& row);
std::string track_gap_json(std::uint64_t missing, double time_s);

}  // namespace drivebench::command
