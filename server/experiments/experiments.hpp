#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "bench.pb.h"
#include "server/config/config.hpp"
#include "server/experiments/disk_thread.hpp"
#include "server/experiments/plan.hpp"
#include "server/experiments/run.hpp"
#include "server/host/asio.hpp"

namespace drivebench {

/// An experiment of the server, from its request to its end.
struct Experiment {
  std::uint64_t id = 0;
  v1::RunExperiment request;
  ExperimentPlan plan;      ///< empty after the end
  std::uint64_t round = 0;  ///< the experiments of a round run before those of the next
  bool is_stored = false;   ///< on the disk: clients may see it
  std::uint64_t end = 0;    ///< order of the ends, from 1 on; 0: not ended
  RunProgress progress;
  v1::ExperimentInfo info;  ///< without tick, rows and queue position
};

/// Writes a file that exists either whole or not at all, also after a power cut, and that only the server's
/// user can read. Throws std::system_error.
void write_whole(const std::filesystem::path& file, const std::string& bytes);
/// A replacement for write_whole(): tests use disks that are full or stand still.
using WriteFile = std::function<void(const std::filesystem::path&, const std::string&)>;

/// The experiments of a server: a queue, one thread that runs them one after the other on benches of their
/// own, and a folder that keeps them. All methods are called on the I/O thread, and none waits for a disk:
/// the worker writes the files of the running experiment, the disk thread all others.
///
/// The queue is fair: in each round every owner has one turn; within a round the first request runs first.
class Experiments {
 public:
  /// Loads the folder. Throws std::runtime_error if the folder cannot be used or another server uses it.
  Experiments(asio::io_context& io, const BenchConfig& config, WriteFile write_file = write_whole);
  /// Ends the running experiment with the safe action, and the queue.
  ~Experiments();
  Experiments(const Experiments&) = delete;
  Experiments& operator=(const Experiments&) = delete;

  /// Called when the state or the data of an experiment may have changed.
  std::function<void()> on_change;

  /// Called with the experiment once it is on the disk, or with null and the error.
  using Answer = std::function<void(const std::shared_ptr<const Experiment>&, const std::string& why_not)>;

  // These throw BadRequest.
  void submit(const v1::RunExperiment& request, const TableLookup& tables, Answer answer);
  /// The experiment with this id, if the owner may read its data.
  std::shared_ptr<const Experiment> find(std::uint64_t id, const std::string& owner) const;
  std::shared_ptr<const Experiment> cancel(std::uint64_t id, const std::string& owner);

  v1::ExperimentInfo info_of(const Experiment& experiment) const;
  v1::ExperimentList list(const std::string& owner) const;

  std::filesystem::path rows_file(std::uint64_t id) const { return file_of(id, ".rows"); }
  std::filesystem::path recording_file(std::uint64_t id) const { return file_of(id, ".mcap"); }

  /// A new table for a session. Throws BadRequest if all sessions together have too many, and
  /// std::system_error.
  std::shared_ptr<SignalTable> new_table();
  /// The most rows of all tables of a session.
  std::uint64_t max_table_rows() const { return config_.experiments.table_rows; }
  /// Throws BadRequest if the tables of all sessions cannot take this many more rows.
  void check_rows(std::uint64_t more) const;

  static bool has_ended(v1::ExperimentState state) noexcept { return state > v1::EXPERIMENT_STATE_RUNNING; }

 private:
  using Pointer = std::shared_ptr<Experiment>;

  /// The number of sessions that can have the largest tables at the same time.
  static constexpr std::uint64_t kSharesOfTables = 4;
  /// The most tables of all sessions, each of which is a file.
  static constexpr std::size_t kMaxTables = 1024;

  /// The ending of the files of tables, whose numbers are no ids.
  static constexpr std::string_view kTableEnding = ".table";

  std::filesystem::path file_of(std::uint64_t id, std::string_view ending) const;
  void lock_folder();
  void load();
  Pointer load_one(const std::filesystem::path& file, std::uint64_t id) const;
  void store(const Experiment& experiment, const v1::ExperimentInfo& info) const;
  void try_to_store(const Experiment& experiment, const v1::ExperimentInfo& info) const;
  void keep_new(const Pointer& experiment);
  Pointer known(const v1::RunExperiment& request) const;
  Pointer at(std::uint64_t id) const;
  std::uint64_t round_for(const std::string& owner) const;
  void check_room() const;
  void keep_ended(Experiment& experiment);
  void remove(std::uint64_t id) const;
  void watch();

  void work();
  Pointer next() const;
  void run(const Pointer& experiment);
  void end(const Pointer& experiment, const RunOutcome& outcome);
  void notify();

  asio::io_context& io_;
  BenchConfig config_;
  std::filesystem::path folder_;
  WriteFile write_file_;
  int lock_ = -1;
  ServerTimer timer_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);  // for posted handlers; I/O thread only
  std::atomic<bool> notified_{false};
  std::vector<std::weak_ptr<SignalTable>> tables_;        // of all sessions
  std::uint64_t last_table_ = 0;                          // the number in the name of its file
  std::map<std::uint64_t, std::vector<Answer>> answers_;  // by id, until the experiment is on the disk

  // Guards the members below. Never locked in a tick of the live bench, nor during a disk access.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::uint64_t, Pointer> all_;
  std::uint64_t last_id_ = 0;
  std::uint64_t last_end_ = 0;
  std::uint64_t round_ = 0;
  Pointer running_;
  bool stop_ = false;

  std::optional<DiskThread> disk_{std::in_place};  // files of experiments that do not run
  std::thread worker_;
};

/// Compares in a time that does not depend on the place of the first difference.
bool same_secret(std::string_view a, std::string_view b) noexcept;

}  // namespace drivebench
