// Requests about experiments.
#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::link {

using Kind = v1::Envelope::KindCase;

v1::ExperimentInfo Link::run_experiment(const v1::RunExperiment& wanted) {
  v1::Envelope& request = new_request();
  *request.mutable_run_experiment() = wanted;
  return ask(request, Kind::kExperimentInfo).experiment_info();
}

v1::TableInfo Link::upload_table(const v1::UploadTable& rows) {
  v1::Envelope& request = new_request();
  *request.mutable_upload_table() = rows;
  return ask(request, Kind::kTableInfo).table_info();
}

v1::ExperimentList Link::list_experiments(const std::string& owner) {
  v1::Envelope& request = new_request();
  request.mutable_list_experiments()->set_owner(owner);
  return ask(request, Kind::kExperimentList).experiment_list();
}

v1::ExperimentInfo Link::cancel_experiment(std::uint64_t id, const std::string& owner) {
  v1::Envelope& request = new_request();
  request.mutable_cancel_experiment()->set_id(id);
  request.mutable_cancel_experiment()->set_owner(owner);
  return ask(request, Kind::kExperimentInfo).experiment_info();
}

v1::ExperimentInfo Link::begin_fetch(const v1::FetchExperiment& wanted) {
  v1::Envelope& request = new_request();
  *request.mutable_fetch_experiment() = wanted;
  return ask(request, Kind::kExperimentInfo).experiment_info();
}

const v1::Envelope& Link::next_of_fetch() {
  if (!socket_.is_open()) throw LinkError("the link to " + peer_ + " is closed");
  arena_.Reset();
  const v1::Envelope& answer = await_answer();
  if (answer.kind_case() == Kind::kRefusal) throw RefusalError(answer.refusal());
  if (answer.kind_case() != Kind::kExperimentData && answer.kind_case() != Kind::kExperimentInfo) {
    fail("sent something else than the data of an experiment");
  }
  return answer;
}

}  // namespace drivebench::link
