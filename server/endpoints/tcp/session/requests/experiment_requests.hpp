#pragma once

#include <exception>

#include "server/endpoints/tcp/session/dialogue.hpp"
#include "server/experiments/experiments.hpp"

namespace drivebench {

/// Carries out a request about experiments; an exception of the action becomes a refusal.
template <class Action>
void with_experiments(Dialogue& dialogue, Action action) {
  const std::uint64_t id = dialogue.id();
  Experiments* const experiments = dialogue.context().experiments;
  if (experiments == nullptr) {
    return dialogue.refuse(id, v1::REFUSAL_NOT_AVAILABLE,
                           "this bench keeps no experiments: its configuration has no [experiments]",
                           "experiments");
  }
  try {
    action(*experiments);
  } catch (const BadRequest& bad) {
    dialogue.refuse(id, bad.code(), bad.what(), bad.field().c_str());
  } catch (const std::exception& error) {
    dialogue.refuse(id, v1::REFUSAL_NOT_AVAILABLE, error.what(), "experiments");
  }
}

/// Answers the request with this id with the state of the experiment.
void send_info(Dialogue& dialogue, std::uint64_t id, const Experiment& experiment);

void run_experiment(Dialogue& dialogue, const TableLookup& tables, const v1::RunExperiment& request);
void list_experiments(Dialogue& dialogue, const v1::ListExperiments& request);
void cancel_experiment(Dialogue& dialogue, const v1::CancelExperiment& request);

}  // namespace drivebench
