// The folder of the experiments: loading, storing and deleting.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <limits>
#include <optional>
#include <set>
#include <system_error>

#include "server/config/experiment_limits.hpp"
#include "server/experiments/experiments.hpp"
#include "server/experiments/row_file.hpp"
#include "server/host/holder.hpp"
#include "server/host/logging/log.hpp"
#include "server/recording/recording_file.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxStoredBytes = std::size_t{4} * 1024 * 1024;

constexpr auto kEndings =
    std::to_array<std::string_view>({".experiment", ".rows", ".mcap", ".experiment.new"});

/// The number in the name of a file with one of these endings, at most the largest that the type holds;
/// nothing for other files.
std::optional<std::uint64_t> number_in(const std::filesystem::path& file,
                                       std::span<const std::string_view> endings) {
  const std::string name = file.filename().string();
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  const std::string_view ending(end, name.data() + name.size());
  if (error == std::errc::invalid_argument || std::ranges::find(endings, ending) == endings.end()) return {};
  return error == std::errc{} ? number : std::numeric_limits<std::uint64_t>::max();
}

/// The rule that the file of this experiment breaks; empty: none. Other code relies on these rules.
std::string_view rule_broken_by(const v1::StoredExperiment& stored, std::uint64_t id) {
  const v1::ExperimentInfo& info = stored.info();
  if (info.id() != id) return "its id must be the number in its name";
  if (stored.request().owner().empty()) return "it must have an owner";
  if (info.decimation() == 0) return "its decimation must be 1 at least";
  const auto signals = static_cast<std::size_t>(info.signals_size());
  if (signals == 0 || signals > kSignals.size()) return "it must have a signal, and none twice";
  if (info.ByteSizeLong() > kMaxExperimentInfoBytes)
    return "its entry in the list must have at most 2048 bytes";
  return {};
}

[[noreturn]] void refuse_folder(const std::filesystem::path& folder, const std::string& why) {
  throw std::runtime_error("cannot keep experiments in " + folder.string() + ": " + why);
}

/// A folder that the server makes is its user's alone, from the first moment on.
void make_folder(const std::filesystem::path& folder) {
  std::error_code ignored;
  const std::filesystem::path last = folder.has_filename() ? folder : folder.parent_path();  // not "kept/"
  if (last.has_parent_path()) std::filesystem::create_directories(last.parent_path(), ignored);
  if (::mkdir(last.c_str(), S_IRWXU) != 0 && errno != EEXIST) {
    refuse_folder(folder, std::generic_category().message(errno));
  }
}

/// A user that may write into the folder may replace what clients have stored. A group may be meant to.
void check_rights(const std::filesystem::path& folder) {
  struct stat status = {};
  if (::stat(folder.c_str(), &status) != 0) refuse_folder(folder, std::generic_category().message(errno));
  if ((status.st_mode & S_IWOTH) != 0) refuse_folder(folder, "every user may write into it: chmod 700 it");
  if ((status.st_mode & S_IWGRP) != 0) log::warn("the group of {} may write into it", folder.string());
  if (status.st_uid != ::geteuid() && status.st_uid != 0) {
    log::warn("{} belongs to user {}, which may write into it", folder.string(), status.st_uid);
  }
}

}  // namespace

void write_whole(const std::filesystem::path& file, const std::string& bytes) {
  const std::string draft = file.string() + ".new";
  ::unlink(draft.c_str());  // an old draft may have another owner or be open elsewhere
  const int descriptor = ::open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  bool done =
      descriptor >= 0 && write_all(descriptor, std::as_bytes(std::span(bytes))) && ::fsync(descriptor) == 0;
  int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (done && ::rename(draft.c_str(), file.c_str()) != 0) {
    done = false;
    error = errno;
  }
  if (!done) throw std::system_error(error, std::generic_category(), "cannot write " + draft);
  sync_folder_of(file);
}

std::filesystem::path Experiments::file_of(std::uint64_t id, std::string_view ending) const {
  return folder_ / std::to_string(id).append(ending);
}

void Experiments::lock_folder() {
  make_folder(folder_);
  check_rights(folder_);
  const std::string file = (folder_ / "lock").string();
  lock_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_ < 0) {
    refuse_folder(folder_, std::generic_category().message(errno));
  }
  if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock_);
    refuse_folder(folder_, "another server does" + holder_of_file(file));
  }
}

void Experiments::load() {
  std::set<std::uint64_t> found;
  std::vector<std::filesystem::path> old_tables;  // of sessions that a crash has ended
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    const auto table = number_in(entry.path(), {&kTableEnding, 1});
    if (table && *table > 0 && *table <= kMaxExperimentId) old_tables.push_back(entry.path());
    const std::optional<std::uint64_t> number = number_in(entry.path(), kEndings);
    if (!number) continue;
    if (*number > 0 && *number <= kMaxExperimentId) {
      found.insert(*number);
    } else {
      log::warn("{} is not an experiment: its number must lie between 1 and {}", entry.path().string(),
                kMaxExperimentId);
    }
  }
  for (const std::filesystem::path& table : old_tables) {
    std::error_code ignored;
    std::filesystem::remove(table, ignored);
  }
  std::vector<std::pair<std::filesystem::file_time_type, Pointer>> ended;
  for (const std::uint64_t id : found) {
    last_id_ = std::max(last_id_, id);
    std::error_code ignored;
    const std::filesystem::path file = file_of(id, ".experiment");
    if (!std::filesystem::exists(file)) {
      remove(id);  // a crash left data without an experiment file
      continue;
    }
    std::filesystem::remove(file_of(id, ".experiment.new"), ignored);
    if (Pointer experiment = load_one(file, id)) {
      all_[id] = experiment;
      ended.emplace_back(std::filesystem::last_write_time(file, ignored), std::move(experiment));
    }
  }
  // The last write of an experiment file is that of its end.
  std::stable_sort(ended.begin(), ended.end(),
                   [](const auto& x, const auto& y) { return x.first < y.first; });
  for (const auto& [time, experiment] : ended)
    keep_ended(*experiment);
}

Experiments::Pointer Experiments::load_one(const std::filesystem::path& file, std::uint64_t id) const {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  v1::StoredExperiment stored;
  std::ifstream in(file, std::ios::binary);
  const bool is_read = !error && size <= kMaxStoredBytes && stored.ParseFromIstream(&in);
  const std::string_view rule =
      is_read ? rule_broken_by(stored, id) : "it must be a StoredExperiment of 4 MiB at most";
  if (!rule.empty()) {
    log::warn("{} is not an experiment: {}", file.string(), rule);
    return nullptr;
  }
  auto experiment = std::make_shared<Experiment>();
  experiment->id = id;
  experiment->is_stored = true;
  experiment->request = stored.request();
  experiment->info = stored.info();
  experiment->progress.tick.store(stored.info().tick());
  experiment->progress.rows.store(stored.info().rows());
  if (!has_ended(stored.info().state())) {
    experiment->info.set_state(v1::EXPERIMENT_STATE_FAILED);
    experiment->info.set_reason("the server ended before it");
    try_to_store(*experiment, experiment->info);
  }
  return experiment;
}

void Experiments::store(const Experiment& experiment, const v1::ExperimentInfo& info) const {
  v1::StoredExperiment stored;
  *stored.mutable_request() = experiment.request;
  *stored.mutable_info() = info;
  stored.mutable_info()->set_tick(experiment.progress.tick.load());
  stored.mutable_info()->set_rows(experiment.progress.rows.load());
  write_file_(file_of(experiment.id, ".experiment"), stored.SerializeAsString());
}

void Experiments::try_to_store(const Experiment& experiment, const v1::ExperimentInfo& info) const {
  try {
    store(experiment, info);
  } catch (const std::exception& error) {
    log::error("experiment {}: {}", experiment.id, error.what());
  }
}

void Experiments::remove(std::uint64_t id) const {
  for (const std::string_view ending : kEndings) {
    std::error_code ignored;
    std::filesystem::remove(file_of(id, ending), ignored);
  }
}

/// Records the end of an experiment. Beyond `kept` it deletes the experiment that ended first, not the one
/// with the lowest id, whose data may be new after a long wait in the queue.
void Experiments::keep_ended(Experiment& experiment) {
  experiment.end = ++last_end_;
  std::vector<Pointer> ended;
  for (const auto& [id, each] : all_) {
    if (each->end != 0) ended.push_back(each);
  }
  if (ended.size() <= config_.experiments.kept) return;
  const Pointer& first = *std::ranges::min_element(ended, {}, [](const Pointer& each) { return each->end; });
  all_.erase(first->id);
  disk_->add([this, id = first->id] { remove(id); });
}

}  // namespace drivebench
