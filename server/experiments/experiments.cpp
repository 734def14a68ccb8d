#include "server/experiments/experiments.hpp"

#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "protocols/text.hpp"
#include "server/config/experiment_limits.hpp"
#include "server/host/logging/log.hpp"
#include "server/recording/input_codec.hpp"

namespace drivebench {
namespace {

constexpr auto kWatchInterval = std::chrono::milliseconds(250);
/// The worker runs below all threads with deadlines.
constexpr int kWorkerNice = 10;
/// The most requests that wait for one experiment to reach the disk.
constexpr std::size_t kMaxAnswers = 64;

}  // namespace

bool same_secret(std::string_view a, std::string_view b) noexcept {
  unsigned difference = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference |= static_cast<unsigned>(a[i]) ^ static_cast<unsigned>(b.empty() ? '\0' : b[i % b.size()]);
  }
  return difference == 0;
}

Experiments::Experiments(asio::io_context& io, const BenchConfig& config, WriteFile write_file)
    : io_(io),
      config_(config),
      folder_(config.experiments.folder),
      write_file_(std::move(write_file)),
      timer_(io) {
  lock_folder();
  load();
  maximum_length_sequence(kMaxPrbsOrder);  // takes milliseconds: now, not while the live bench runs
  worker_ = std::thread([this] { work(); });
}

Experiments::~Experiments() {
  *alive_ = false;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    if (running_) running_->progress.cancel.store(true);
  }
  changed_.notify_all();
  worker_.join();
  disk_.reset();
  ::close(lock_);
}

// ---- requests ----

Experiments::Pointer Experiments::known(const v1::RunExperiment& request) const {
  if (request.request_key().empty()) return nullptr;
  for (const auto& [id, experiment] : all_) {
    const v1::RunExperiment& other = experiment->request;
    if (other.request_key() != request.request_key() || !same_secret(request.owner(), other.owner()))
      continue;
    // Table numbers belong to a session, and the client may have a new session.
    const auto without_tables = [](v1::RunExperiment r) {
      for (v1::Shape& shape : *r.mutable_input()->mutable_shapes()) {
        if (shape.has_table()) shape.mutable_table()->clear_id();
      }
      return r.SerializeAsString();
    };
    if (without_tables(other) == without_tables(request)) return experiment;
    throw BadRequest(v1::REFUSAL_OUT_OF_RANGE, "request_key",
                     fmt::format("request_key belongs to experiment {}, whose request differs", id));
  }
  return nullptr;
}

void Experiments::check_room() const {
  if (last_id_ >= kMaxExperimentId) {
    throw BadRequest(
        v1::REFUSAL_BUSY, "id",
        fmt::format("the folder has a file with number {}, the largest that there may be", last_id_));
  }
  const auto waiting = std::count_if(all_.begin(), all_.end(), [](const auto& each) {
    return each.second->info.state() == v1::EXPERIMENT_STATE_QUEUED;
  });
  if (waiting < static_cast<std::ptrdiff_t>(config_.experiments.queue_length)) return;
  throw BadRequest(v1::REFUSAL_BUSY, "queue",
                   fmt::format("{} experiments are waiting, and the queue holds no more", waiting));
}

std::uint64_t Experiments::round_for(const std::string& owner) const {
  std::uint64_t round = round_;
  for (const auto& [id, experiment] : all_) {
    if (!has_ended(experiment->info.state()) && experiment->request.owner() == owner) {
      round = std::max(round, experiment->round + 1);
    }
  }
  return round;
}

void Experiments::submit(const v1::RunExperiment& request, const TableLookup& tables, Answer answer) {
  Pointer same;
  {
    const std::lock_guard lock(mutex_);
    same = known(request);
    if (same == nullptr) check_room();
  }
  if (same != nullptr) {
    const auto waiting = answers_.find(same->id);
    if (waiting == answers_.end()) return answer(same, {});
    if (waiting->second.size() == kMaxAnswers) {
      throw BadRequest(v1::REFUSAL_BUSY, "request_key",
                       fmt::format("experiment {} is not on the disk yet, and {} requests wait for it",
                                   same->id, kMaxAnswers));
    }
    return waiting->second.push_back(std::move(answer));
  }
  auto experiment = std::make_shared<Experiment>();
  experiment->plan = make_plan(request, config_, tables);
  experiment->request = request;
  v1::ExperimentInfo& info = experiment->info;
  info.set_state(v1::EXPERIMENT_STATE_QUEUED);
  info.set_user(request.user());
  info.set_label(request.label());
  info.set_shared(request.shared());
  info.set_mode(request.mode());
  info.set_axis(request.axis());
  info.set_ticks(static_cast<std::uint64_t>(experiment->plan.ticks));
  info.set_decimation(static_cast<std::uint32_t>(experiment->plan.decimation));
  info.set_period_s(experiment->plan.period_s());
  *info.mutable_signals() = request.signals();
  {
    const std::lock_guard lock(mutex_);
    experiment->id = ++last_id_;
    info.set_id(experiment->id);
    experiment->round = round_for(request.owner());
    all_[experiment->id] = experiment;
  }
  answers_[experiment->id].push_back(std::move(answer));
  disk_->add([this, experiment] { keep_new(experiment); });
}

/// Stores a new experiment. Runs on the disk thread.
void Experiments::keep_new(const Pointer& experiment) {
  std::string why_not;
  try {
    store(*experiment, experiment->info);
  } catch (const std::exception& error) {
    why_not = error.what();
    remove(experiment->id);
  }
  {
    const std::lock_guard lock(mutex_);
    experiment->is_stored = why_not.empty();
    if (!experiment->is_stored) all_.erase(experiment->id);
  }
  changed_.notify_all();
  asio::post(io_, [this, alive = alive_, experiment, why_not] {
    if (!*alive) return;
    const auto answers = answers_.extract(experiment->id);
    for (const Answer& answer : answers.mapped())
      answer(why_not.empty() ? experiment : nullptr, why_not);
    watch();
  });
}

Experiments::Pointer Experiments::at(std::uint64_t id) const {
  const auto found = all_.find(id);
  if (found != all_.end() && found->second->is_stored) return found->second;
  throw BadRequest(v1::REFUSAL_UNKNOWN_EXPERIMENT, "id", fmt::format("there is no experiment {}", id));
}

std::shared_ptr<const Experiment> Experiments::find(std::uint64_t id, const std::string& owner) const {
  const std::lock_guard lock(mutex_);
  Pointer experiment = at(id);
  if (experiment->request.shared() || same_secret(owner, experiment->request.owner())) return experiment;
  throw BadRequest(v1::REFUSAL_NOT_OWNER, "owner", fmt::format("experiment {} belongs to another owner", id));
}

std::shared_ptr<const Experiment> Experiments::cancel(std::uint64_t id, const std::string& owner) {
  Pointer experiment;
  {
    const std::lock_guard lock(mutex_);
    experiment = at(id);
    if (!same_secret(owner, experiment->request.owner())) {
      throw BadRequest(v1::REFUSAL_NOT_OWNER, "owner",
                       fmt::format("experiment {} belongs to another owner", id));
    }
    experiment->progress.cancel.store(true);
    if (experiment->info.state() != v1::EXPERIMENT_STATE_QUEUED) return experiment;
    experiment->info.set_state(v1::EXPERIMENT_STATE_CANCELLED);
    experiment->info.set_reason("cancelled before it began");
    experiment->plan = {};
    disk_->add([this, experiment] { try_to_store(*experiment, experiment->info); });
    keep_ended(*experiment);
  }
  on_change();
  return experiment;
}

v1::ExperimentInfo Experiments::info_of(const Experiment& experiment) const {
  const std::lock_guard lock(mutex_);
  v1::ExperimentInfo info = experiment.info;
  info.set_tick(experiment.progress.tick.load(std::memory_order_relaxed));
  info.set_rows(experiment.progress.rows.load(std::memory_order_acquire));
  if (info.state() == v1::EXPERIMENT_STATE_QUEUED) {
    const auto before = std::count_if(all_.begin(), all_.end(), [&](const auto& each) {
      const Experiment& other = *each.second;
      return other.info.state() == v1::EXPERIMENT_STATE_QUEUED &&
             std::pair(other.round, other.id) < std::pair(experiment.round, experiment.id);
    });
    info.set_position(static_cast<std::uint32_t>(before) + 1);
  }
  return info;
}

v1::ExperimentList Experiments::list(const std::string& owner) const {
  std::vector<Pointer> experiments;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [id, experiment] : all_) {
      if (experiment->is_stored) experiments.push_back(experiment);
    }
  }
  v1::ExperimentList result;
  for (const Pointer& experiment : experiments) {
    const v1::ExperimentInfo info = info_of(*experiment);
    v1::ExperimentInfo& out = *result.add_experiments();
    if (experiment->request.shared() || same_secret(owner, experiment->request.owner())) {
      out = info;
    } else {
      out.set_id(info.id());
      out.set_state(info.state());
      out.set_position(info.position());
      out.set_user(info.user());
    }
  }
  return result;
}

std::shared_ptr<SignalTable> Experiments::new_table() {
  std::erase_if(tables_, [](const auto& table) { return table.expired(); });
  if (tables_.size() >= kMaxTables) {
    throw BadRequest(v1::REFUSAL_BUSY, "table",
                     fmt::format("all sessions together have {} tables, as many as may be", kMaxTables));
  }
  auto table = std::make_shared<SignalTable>(file_of(++last_table_, kTableEnding));
  tables_.push_back(table);
  return table;
}

void Experiments::check_rows(std::uint64_t more) const {
  std::uint64_t rows = more;
  for (const auto& each : tables_) {
    if (const auto table = each.lock()) rows += table->size();
  }
  if (rows <= kSharesOfTables * config_.experiments.table_rows) return;
  throw BadRequest(v1::REFUSAL_BUSY, "times_s",
                   "the tables of all sessions together would have too many rows");
}

/// While an experiment is queued or runs, calls on_change regularly, also without new rows.
void Experiments::watch() {
  timer_.expires_after(kWatchInterval);
  timer_.async_wait([this, alive = alive_](const boost::system::error_code& error) {
    if (error || !*alive) return;
    on_change();
    const std::lock_guard lock(mutex_);
    const bool busy = std::any_of(all_.begin(), all_.end(),
                                  [](const auto& each) { return !has_ended(each.second->info.state()); });
    if (busy) watch();
  });
}

// ---- the worker ----

void Experiments::notify() {
  if (notified_.exchange(true)) return;
  asio::post(io_, [this, alive = alive_] {
    if (!*alive) return;
    notified_.store(false);
    on_change();
  });
}

Experiments::Pointer Experiments::next() const {
  Pointer first;
  for (const auto& [id, experiment] : all_) {
    if (experiment->info.state() != v1::EXPERIMENT_STATE_QUEUED || !experiment->is_stored) continue;
    if (!first || experiment->round < first->round) first = experiment;
  }
  return first;
}

void Experiments::work() {
  // On Linux this sets the priority of the thread.
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), kWorkerNice);
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || next() != nullptr; });
    if (stop_) return;
    running_ = next();
    running_->info.set_state(v1::EXPERIMENT_STATE_RUNNING);
    round_ = running_->round;
    const Pointer experiment = running_;
    lock.unlock();
    notify();
    run(experiment);
    lock.lock();
  }
}

void Experiments::run(const Pointer& experiment) {
  v1::RunExperiment request = experiment->request;
  request.clear_owner();  // other clients may get the recording
  RunOutcome outcome;
  try {
    outcome = run_experiment(experiment->plan,
                             {.recording = recording_file(experiment->id), .rows = rows_file(experiment->id)},
                             request.SerializeAsString(), experiment->progress, [this] { notify(); });
  } catch (const std::exception& error) {
    outcome = {.state = v1::EXPERIMENT_STATE_FAILED, .reason = error.what(), .verdict = {}};
  }
  end(experiment, outcome);
  notify();
}

/// Ends an experiment: stores it before clients can see the end.
void Experiments::end(const Pointer& experiment, const RunOutcome& outcome) {
  v1::ExperimentInfo info = experiment->info;  // only this thread changes it during the run
  info.set_state(outcome.state);
  info.set_reason(utf8(outcome.reason, kMaxExperimentReasonBytes));
  if (outcome.state == v1::EXPERIMENT_STATE_CANCELLED) {
    const std::lock_guard lock(mutex_);
    if (stop_) info.set_reason("the server ended");
  }
  encode_verdict(outcome.verdict, *info.mutable_verdict());
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(recording_file(experiment->id), error);
  info.set_recording_bytes(error ? 0 : bytes);
  try_to_store(*experiment, info);
  const ExperimentPlan over = std::exchange(experiment->plan, {});  // destroyed after the lock is released
  const std::lock_guard lock(mutex_);
  experiment->info.Swap(&info);
  running_.reset();
  keep_ended(*experiment);
}

}  // namespace drivebench
