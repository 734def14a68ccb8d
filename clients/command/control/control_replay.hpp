#pragma once

#include <functional>

#include "clients/command/recording/recorded_run.hpp"
#include "clients/control/loop/run.hpp"

namespace drivebench::command {

/// Hands the samples of a recording to a run in place of the controller that was recorded; `see` gets each
/// sample and the run's answer, until the run is done. Throws UsageError if both have different sample rates.
void answer_recorded(const RecordedRun& recorded, control::Run& run,
                     const std::function<void(const Answered&, const control::Setpoint&)>& see);

}  // namespace drivebench::command
