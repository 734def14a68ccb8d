#include "server/endpoints/tcp/session/requests/experiment_requests.hpp"

namespace drivebench {

void send_info(Dialogue& dialogue, std::uint64_t id, const Experiment& experiment) {
  *dialogue.begin_reply(id).mutable_experiment_info() = dialogue.context().experiments->info_of(experiment);
  dialogue.send_reply();
}

void run_experiment(Dialogue& dialogue, const TableLookup& tables, const v1::RunExperiment& r) {
  with_experiments(dialogue, [&](Experiments& experiments) {
    experiments.submit(r, tables,
                       [&dialogue, session = dialogue.keep_alive(), id = dialogue.id()](
                           const std::shared_ptr<const Experiment>& experiment, const std::string& why_not) {
                         if (experiment == nullptr) {
                           return dialogue.refuse(id, v1::REFUSAL_NOT_AVAILABLE, why_not, "experiments");
                         }
                         const v1::RunExperiment& wanted = experiment->request;
                         dialogue.audit(
                             "experiment", "done",
                             {{"id", experiment->id}, {"user", wanted.user()}, {"label", wanted.label()}});
                         send_info(dialogue, id, *experiment);
                       });
  });
}

void list_experiments(Dialogue& dialogue, const v1::ListExperiments& r) {
  with_experiments(dialogue, [&](Experiments& experiments) {
    *dialogue.begin_reply(dialogue.id()).mutable_experiment_list() = experiments.list(r.owner());
    dialogue.send_reply();
  });
}

void cancel_experiment(Dialogue& dialogue, const v1::CancelExperiment& r) {
  with_experiments(dialogue, [&](Experiments& experiments) {
    const std::shared_ptr<const Experiment> experiment = experiments.cancel(r.id(), r.owner());
    dialogue.audit("experiment_cancelled", "done", {{"id", r.id()}});
    send_info(dialogue, dialogue.id(), *experiment);
  });
}

}  // namespace drivebench
