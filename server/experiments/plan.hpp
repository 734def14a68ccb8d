#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench.pb.h"
#include "protocols/signals/catalogue.hpp"
#include "server/config/config.hpp"
#include "server/experiments/shapes.hpp"

namespace drivebench {

/// A refused request: what() is a sentence with value and rule.
class BadRequest : public std::runtime_error {
 public:
  BadRequest(v1::RefusalCode code, std::string field, const std::string& sentence)
      : std::runtime_error(sentence), code_(code), field_(std::move(field)) {}
  v1::RefusalCode code() const noexcept { return code_; }
  const std::string& field() const noexcept { return field_; }  ///< for example "input.shapes[2].sine"

 private:
  v1::RefusalCode code_;
  std::string field_;
};

/// A change of an axis at the start of a tick.
struct PlannedEvent {
  Tick tick;
  std::uint32_t axis;
  Action action;
};

/// The angle of the dq transform, and its computation from a sample.
struct DqAngle {
  bool is_measured = false;
  double pole_pairs = 1.0;
  double rad_per_count = 0.0;
  double offset_counts = 0.0;  ///< from encoder_count to the middle of the count
  double back_emf_vs = 0.0;
};

/// A checked request: everything that a run needs.
struct ExperimentPlan {
  BenchConfig config;  ///< with the settings of the request, in free mode
  RunMode mode = RunMode::kFree;
  std::uint32_t axis = 0;
  Tick ticks = 0;
  Tick decimation = 1;
  std::vector<const Signal*> signals;
  v1::InputKind input = v1::INPUT_KIND_NONE;
  Connection connection = Connection::kTwoPhase;
  DqAngle dq;
  std::vector<InputShape> shapes;
  std::vector<PlannedEvent> events;  ///< by tick
  v1::StopLimits stop;

  double period_s() const noexcept { return static_cast<double>(config.setup.period_ns) * 1e-9; }
  bool has_commands() const noexcept {
    return input != v1::INPUT_KIND_NONE && input != v1::INPUT_KIND_SOURCE;
  }
};

/// Finds the table that a shape names; null if the session has none with this number.
using TableLookup = std::function<std::shared_ptr<const SignalTable>(std::uint64_t)>;

inline constexpr double kMaxInputValue = 1e6;  ///< largest magnitude of a shape
inline constexpr int kMaxShapes = 256;
inline constexpr int kMaxHarmonics = 1000;  ///< of all shapes together
inline constexpr int kMaxPlannedEvents = 256;
inline constexpr Tick kMaxExperimentTicks = 100'000'000;

/// Checks a request against the server's configuration. Throws BadRequest for the first problem.
ExperimentPlan make_plan(const v1::RunExperiment& request, const BenchConfig& config,
                         const TableLookup& tables);

/// The command that answers the sample of a tick: a pure function.
PhaseCommand command_of(const ExperimentPlan& plan, const Sample& sample, Tick tick) noexcept;

/// The first limit that the sample exceeds, as a sentence; empty: none.
std::string broken_limit(const v1::StopLimits& stop, const Sample& sample);
/// Whether the sample exceeds a limit.
bool is_beyond(const v1::StopLimits& stop, const Sample& sample) noexcept;

}  // namespace drivebench
