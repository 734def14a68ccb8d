// The queue of experiments and its folder, in process, with disks that stand still or are full.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <fstream>
#include <semaphore>

#include "protocols/framing.hpp"
#include "server/config/experiment_limits.hpp"
#include "server/experiments/experiments.hpp"
#include "tests/server/experiments/experiment_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::experiment_queue_test {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 10s;
const std::string kOwner = "a secret";

/// Writes as often as it is let, and stands still otherwise.
class StallingDisk {
 public:
  WriteFile writer() {
    return [this](const std::filesystem::path& file, const std::string& bytes) {
      ++begun_;
      if (!may_write_.try_acquire_for(kPatience)) stood_too_long_ = true;
      if (is_full_) throw std::system_error(ENOSPC, std::generic_category(), "cannot write");
      std::ofstream(file, std::ios::binary) << bytes;
    };
  }
  void let(int writes) { may_write_.release(writes); }
  void fill(bool is_full) { is_full_ = is_full; }
  int begun() const { return begun_; }
  /// A thread waited for the disk that also had to release it.
  bool stood_too_long() const { return stood_too_long_; }

 private:
  std::counting_semaphore<> may_write_{0};
  std::atomic<int> begun_ = 0;
  std::atomic<bool> is_full_ = false;
  std::atomic<bool> stood_too_long_ = false;
};

v1::RunExperiment request(std::uint64_t ticks = 100) {
  v1::RunExperiment r;
  r.set_owner(kOwner);
  r.set_mode(v1::MODE_FREE);
  r.set_ticks(ticks);
  r.add_signals("speed_rad_s");
  r.mutable_input()->set_kind(v1::INPUT_KIND_NONE);
  return r;
}

/// Paced by the clock: longer than any test.
v1::RunExperiment endless() {
  v1::RunExperiment r = request(400'000);
  r.set_mode(v1::MODE_REALTIME);
  return r;
}

class ExperimentQueue : public testing::Test {
 protected:
  struct Answered {
    std::shared_ptr<const Experiment> experiment;
    std::string why_not;
    bool is_there = false;
  };

  void start() {
    config_.experiments.folder = folder_.path();
    experiments_.emplace(io_, config_, disk_.writer());
    experiments_->on_change = [] {};
  }

  std::shared_ptr<Answered> submit(const v1::RunExperiment& r) {
    auto answered = std::make_shared<Answered>();
    experiments_->submit(
        r, no_tables,
        [answered](const std::shared_ptr<const Experiment>& experiment, const std::string& why_not) {
          *answered = {.experiment = experiment, .why_not = why_not, .is_there = true};
        });
    return answered;
  }

  template <class Condition>
  bool until(Condition condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition() && std::chrono::steady_clock::now() < end) {
      io_.restart();
      io_.run_for(1ms);
    }
    return condition();
  }

  v1::ExperimentState state_of(const Experiment& experiment) {
    return experiments_->info_of(experiment).state();
  }
  std::size_t listed() { return static_cast<std::size_t>(experiments_->list(kOwner).experiments_size()); }

  test::Folder folder_;
  BenchConfig config_ = servo_bench();
  StallingDisk disk_;
  asio::io_context io_;
  std::optional<Experiments> experiments_;
};

// Catches: an I/O thread that waits for the disk, itself or for the lock of the thread that ends an
// experiment; an experiment that is announced, or runs, or ends, before it is on the disk, so that a crash
// forgets it.
TEST_F(ExperimentQueue, TheIoThreadNeverWaitsForTheDisk) {
  start();
  const auto first = submit(request());
  ASSERT_TRUE(until([this] { return disk_.begun() == 1; }));
  io_.poll();
  EXPECT_FALSE(first->is_there);
  EXPECT_EQ(listed(), 0u);
  EXPECT_THROW(experiments_->cancel(1, kOwner), BadRequest);
  disk_.let(1);
  ASSERT_TRUE(until([&] { return first->is_there; })) << "it is on the disk and no client is told";
  ASSERT_NE(first->experiment, nullptr) << first->why_not;
  ASSERT_TRUE(until([this] { return disk_.begun() == 2; })) << "its end does not go to the disk";
  EXPECT_EQ(state_of(*first->experiment), v1::EXPERIMENT_STATE_RUNNING);
  const auto second = submit(request());
  ASSERT_TRUE(until([this] { return disk_.begun() == 3; }));
  EXPECT_EQ(listed(), 1u);
  EXPECT_EQ(experiments_->find(1, kOwner), first->experiment);
  experiments_->cancel(1, kOwner);
  EXPECT_FALSE(disk_.stood_too_long());
  disk_.let(100);
  ASSERT_TRUE(until([&] { return second->is_there; }));
  ASSERT_NE(second->experiment, nullptr);
  for (const auto& each : {first, second}) {
    EXPECT_TRUE(until([&] { return state_of(*each->experiment) == v1::EXPERIMENT_STATE_COMPLETED; }));
  }
}

// Catches: a refusal that leaves an experiment in the queue, or that gives its number to the next one, whose
// files then mix with its remains.
TEST_F(ExperimentQueue, AFullDiskRefusesAndLeavesNothing) {
  config_.experiments.queue_length = 1;
  start();
  disk_.let(100);
  disk_.fill(true);
  const auto refused = submit(request());
  ASSERT_TRUE(until([&] { return refused->is_there; }));
  EXPECT_EQ(refused->experiment, nullptr);
  EXPECT_NE(refused->why_not.find("No space left"), std::string::npos) << refused->why_not;
  EXPECT_EQ(listed(), 0u);
  disk_.fill(false);
  const auto kept = submit(request());
  ASSERT_TRUE(until([&] { return kept->is_there; }));
  ASSERT_NE(kept->experiment, nullptr);
  EXPECT_EQ(kept->experiment->id, 2u);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "1.experiment"));
}

std::ptrdiff_t files_in(const std::filesystem::path& folder) {
  return std::distance(std::filesystem::directory_iterator(folder), {});
}

// Catches: tables that hold a descriptor each, of which 16 sessions with 64 tables take all; no bound for all
// sessions together; files that stay behind a table, or behind a server that was killed; a file of another
// name that is taken for one of these.
TEST_F(ExperimentQueue, LIMIT_11_TablesHoldNoDescriptorsAndLeaveNoFiles) {
  for (const char* left : {"7.table", "table.csv", "7.table.txt"})
    std::ofstream(folder_.path() / left) << "left by a server that was killed";
  start();
  EXPECT_EQ(files_in(folder_.path()), 3) << "the lock and the two others";
  const std::ptrdiff_t descriptors = files_in("/proc/self/fd");
  const std::array rows = {SignalTable::Row{.time_s = 0.0, .value = 1.0}};
  std::vector<std::shared_ptr<SignalTable>> tables;
  for (int i = 0; i < 1024; ++i)
    tables.emplace_back(experiments_->new_table())->append(rows);
  EXPECT_EQ(files_in("/proc/self/fd"), descriptors);
  try {
    experiments_->new_table();
    FAIL() << "a table too many";
  } catch (const BadRequest& bad) {
    EXPECT_EQ(bad.code(), v1::REFUSAL_BUSY);
    EXPECT_EQ(bad.field(), "table");
    EXPECT_STREQ(bad.what(), "all sessions together have 1024 tables, as many as may be");
  }
  const TableView view(*tables.back());
  tables.clear();
  EXPECT_EQ(files_in(folder_.path()), 3);
  EXPECT_EQ(view.at(1.0, false), 1.0) << "an experiment reads on after its session";
  EXPECT_NE(experiments_->new_table(), nullptr);
}

// Catches: a request that is sent again before the disk has it, and then runs twice or is never answered.
TEST_F(ExperimentQueue, ARequestSentAgainBeforeTheDiskHasItRunsOnce) {
  start();
  v1::RunExperiment r = request();
  r.set_request_key("again");
  const auto one = submit(r);
  const auto two = submit(r);
  EXPECT_FALSE(one->is_there || two->is_there);
  disk_.let(100);
  ASSERT_TRUE(until([&] { return one->is_there && two->is_there; }));
  EXPECT_EQ(one->experiment, two->experiment);
  EXPECT_EQ(listed(), 1u);
  const auto three = submit(r);
  EXPECT_TRUE(three->is_there);
  EXPECT_EQ(three->experiment, one->experiment);
}

// Catches: a client that repeats a request while the disk stands still, and is remembered each time.
TEST_F(ExperimentQueue, AtMost64RequestsWaitForOneExperiment) {
  start();
  v1::RunExperiment r = request();
  r.set_request_key("again");
  for (int i = 0; i < 64; ++i)
    submit(r);
  try {
    submit(r);
    ADD_FAILURE() << "one more waits";
  } catch (const BadRequest& bad) {
    EXPECT_EQ(bad.code(), v1::REFUSAL_BUSY);
    EXPECT_EQ(bad.field(), "request_key");
  }
  disk_.let(100);
}

/// As large as an experiment can be.
v1::ExperimentInfo largest_info(std::uint64_t id) {
  v1::ExperimentInfo info;
  info.set_id(id);
  info.set_state(v1::EXPERIMENT_STATE_FAILED);
  info.set_user(std::string(64, 'u'));
  info.set_label(std::string(100, 'l'));
  info.set_mode(v1::MODE_REALTIME);
  info.set_axis(100);
  info.set_ticks(kMaxExperimentTicks);
  info.set_tick(kMaxExperimentTicks);
  info.set_rows(kMaxExperimentTicks);
  info.set_decimation(1'000'000);
  info.set_period_s(1e-4);
  for (const Signal& signal : kSignals)
    info.add_signals(std::string(signal.name));
  info.set_reason(std::string(kMaxExperimentReasonBytes, 'r'));
  info.set_recording_bytes(~std::uint64_t{0} >> 8);
  v1::Verdict& verdict = *info.mutable_verdict();
  verdict.set_ticks(kMaxExperimentTicks);
  verdict.set_late_ticks(kMaxExperimentTicks);
  verdict.set_worst_lateness_s(1.0);
  verdict.set_gaps(kMaxExperimentTicks);
  verdict.set_state_hash(1);
  verdict.set_sentence(std::string(250, 's'));
  for (std::size_t i = 0; i < OctaveHistogram::kBuckets; ++i)
    verdict.add_lateness_counts(kMaxExperimentTicks);
  return info;
}

// Catches: limits of the configuration with which the list exceeds an answer, so that its reader is cut off;
// experiments beyond `kept` that the folder keeps forever.
TEST_F(ExperimentQueue, TheLongestListFitsIntoAnAnswer) {
  for (std::uint64_t id = 1; id <= kMaxKeptExperiments + 3; ++id) {
    v1::StoredExperiment stored;
    stored.mutable_request()->set_owner(kOwner);
    *stored.mutable_info() = largest_info(id);
    ASSERT_LE(stored.info().ByteSizeLong(), kMaxExperimentInfoBytes);
    std::ofstream(folder_.path() / (std::to_string(id) + ".experiment"), std::ios::binary)
        << stored.SerializeAsString();
  }
  config_.experiments.kept = kMaxKeptExperiments;
  config_.experiments.queue_length = kMaxQueuedExperiments;
  start();
  disk_.let(1000);
  v1::RunExperiment r = endless();
  r.set_user(std::string(64, 'u'));
  r.set_label(std::string(100, 'l'));
  r.clear_signals();
  for (const Signal& signal : kSignals)
    r.add_signals(std::string(signal.name));
  const auto running = submit(r);
  ASSERT_TRUE(until(
      [&] { return running->is_there && state_of(*running->experiment) == v1::EXPERIMENT_STATE_RUNNING; }));
  for (std::uint32_t i = 0; i < kMaxQueuedExperiments; ++i)
    submit(r);
  EXPECT_THROW(submit(r), BadRequest);
  constexpr std::size_t kAll = kMaxKeptExperiments + kMaxQueuedExperiments + 1;
  ASSERT_TRUE(until([&] { return listed() == kAll; })) << listed();
  v1::Envelope answer;
  answer.set_id(~std::uint64_t{0});
  *answer.mutable_experiment_list() = experiments_->list(kOwner);
  EXPECT_LE(answer.ByteSizeLong(), kMaxReplyFrame);
}

}  // namespace
}  // namespace drivebench::experiment_queue_test
