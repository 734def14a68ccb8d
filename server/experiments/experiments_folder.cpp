// The folder of the experiments: what is kept, and until when.
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <set>

#include "server/experiments/experiments.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxStoredBytes = std::size_t{4} * 1024 * 1024;

/// The id in the name of a file of ours, 0 if it is none.
std::uint64_t id_of(const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  std::uint64_t id = 0;
  const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), id);
  return error == std::errc{} && end == stem.data() + stem.size() ? id : 0;
}

void write_whole(const std::filesystem::path& file, const std::string& bytes) {
  const std::filesystem::path draft = file.string() + ".new";
  {
    std::ofstream out(draft, std::ios::binary | std::ios::trunc);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) throw std::runtime_error("cannot write " + draft.string());
  }
  std::filesystem::permissions(draft,
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  std::filesystem::rename(draft, file);
}

}  // namespace

std::filesystem::path Experiments::file_of(std::uint64_t id, const char* ending) const {
  return folder_ / (std::to_string(id) + ending);
}

void Experiments::lock_folder() {
  std::error_code error;
  if (std::filesystem::create_directories(folder_, error)) {
    std::filesystem::permissions(folder_, std::filesystem::perms::owner_all, error);
  }
  const std::string file = (folder_ / "lock").string();
  lock_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_ < 0) {
    throw std::runtime_error("cannot keep experiments in " + folder_.string() + ": " +
                             std::generic_category().message(errno));
  }
  if (::flock(lock_, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock_);
    throw std::runtime_error("cannot keep experiments in " + folder_.string() + ": another server does");
  }
}

void Experiments::load() {
  std::set<std::uint64_t> found;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    const std::uint64_t id = id_of(entry.path());
    if (id != 0) found.insert(id);
  }
  for (const std::uint64_t id : found) {
    last_id_ = std::max(last_id_, id);
    if (!std::filesystem::exists(file_of(id, ".experiment"))) {
      remove(id);  // what a crash left before there was anything to know about it
    } else {
      load_one(file_of(id, ".experiment"));
    }
  }
}

void Experiments::load_one(const std::filesystem::path& file) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  v1::StoredExperiment stored;
  std::ifstream in(file, std::ios::binary);
  if (error || size > kMaxStoredBytes || !stored.ParseFromIstream(&in)) {
    spdlog::warn("{} is not an experiment", file.string());
    return;
  }
  auto experiment = std::make_shared<Experiment>();
  experiment->id = id_of(file);
  experiment->request = stored.request();
  experiment->info = stored.info();
  experiment->progress.tick.store(stored.info().tick());
  experiment->progress.rows.store(stored.info().rows());
  if (!has_ended(stored.info().state())) {
    experiment->info.set_state(v1::EXPERIMENT_STATE_FAILED);
    experiment->info.set_reason("the server ended before it");
  }
  all_[experiment->id] = std::move(experiment);
}

void Experiments::store(const Experiment& experiment) const {
  v1::StoredExperiment stored;
  *stored.mutable_request() = experiment.request;
  *stored.mutable_info() = experiment.info;
  stored.mutable_info()->set_tick(experiment.progress.tick.load());
  stored.mutable_info()->set_rows(experiment.progress.rows.load());
  write_whole(file_of(experiment.id, ".experiment"), stored.SerializeAsString());
}

void Experiments::remove(std::uint64_t id) {
  for (const char* const ending : {".experiment", ".rows", ".mcap", ".experiment.new"}) {
    std::error_code ignored;
    std::filesystem::remove(file_of(id, ending), ignored);
  }
}

void Experiments::forget_oldest() {
  std::vector<std::uint64_t> ended;
  for (const auto& [id, experiment] : all_) {
    if (has_ended(experiment->info.state())) ended.push_back(id);
  }
  for (std::size_t i = 0; ended.size() - i > config_.experiments.kept; ++i) {
    remove(ended[i]);
    all_.erase(ended[i]);
  }
}

}  // namespace drivebench
