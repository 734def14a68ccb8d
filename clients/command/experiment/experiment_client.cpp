#include "clients/command/experiment/experiment_client.hpp"

#include <fmt/core.h>
#include <sys/random.h>
#include <sys/stat.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "protocols/document.hpp"

namespace drivebench::command {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kRetryPause = std::chrono::milliseconds(200);

/// A folder that the environment names; empty if it does not.
std::filesystem::path folder_in(const char* variable) {
  const char* const folder = std::getenv(variable);
  return folder == nullptr ? "" : folder;
}

/// The secret of this user, created once and kept in a file that no other user can read.
std::string own_secret() {
  const std::filesystem::path base = folder_in("XDG_CONFIG_HOME");
  const std::filesystem::path home = folder_in("HOME");
  if (base.empty() && home.empty()) throw UsageError("--owner is needed: there is no HOME to keep it in");
  const std::filesystem::path folder = (base.empty() ? home / ".config" : base) / "drivebench";
  const std::filesystem::path file = folder / "owner";
  std::string secret;
  std::ifstream(file) >> secret;
  if (!secret.empty()) return secret;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const mode_t before = ::umask(0077);
  std::ofstream out(file);
  ::umask(before);
  secret = random_word();
  out << secret << '\n';
  out.close();
  if (!out) throw UsageError(fmt::format("--owner is needed: {} cannot be written", file.string()));
  return secret;
}

void upload_tables(link::Link& link, v1::RunExperiment& request) {
  for (v1::Shape& shape : *request.mutable_input()->mutable_shapes()) {
    if (!shape.has_table()) continue;
    std::uint64_t table = 0;
    std::uint64_t rows = 0;
    read_table(shape.table().file(), [&](v1::UploadTable& upload) {
      upload.set_table(table);
      upload.set_first(rows);
      const v1::TableInfo info = link.upload_table(upload);
      table = info.table();
      rows = info.rows();
    });
    shape.mutable_table()->set_id(table);
  }
}

void show(const v1::ExperimentInfo& info, Progress& progress) {
  const double part =
      info.ticks() == 0 ? 0.0 : static_cast<double>(info.tick()) / static_cast<double>(info.ticks());
  progress.update(part, info.position() > 0 ? fmt::format("waiting, {} in the queue", info.position())
                                            : word_of(info.state()));
}

}  // namespace

ExperimentServer server_of_environment() {
  ExperimentServer server;
  if (const char* owner = std::getenv("DRIVEBENCH_OWNER"); owner != nullptr) server.owner = owner;
  if (const char* user = std::getenv("USER"); user != nullptr) server.user = user;
  return server;
}

std::string random_word() {
  std::array<unsigned char, 16> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("the system gives no random numbers");
  }
  std::string word;
  for (const unsigned char byte : bytes)
    word += fmt::format("{:02x}", byte);
  return word;
}

bool has_ended(v1::ExperimentState state) {
  return state > v1::EXPERIMENT_STATE_RUNNING;
}

ExperimentClient::ExperimentClient(const ExperimentServer& server, std::string subcommand)
    : server_(server),
      subcommand_(std::move(subcommand)),
      owner_(server.owner.empty() ? own_secret() : server.owner) {}

bool ExperimentClient::patience_is_over(Clock::time_point since) const {
  return std::chrono::duration<double>(Clock::now() - since).count() > server_.patience_s || interrupted();
}

void ExperimentClient::with_link(const std::function<void(link::Link&)>& action) {
  std::optional<Clock::time_point> broken;
  for (;;) {
    try {
      if (!link_) link_.reset(new link::Link(open_link(server_.link, subcommand_)));  // it does not move
      if (broken) ++resumed_;
      broken.reset();
      return action(*link_);
    } catch (const NotLetIn&) {
      throw;  // a wrong token stays wrong, and each try delays the other clients at this address
    } catch (const link::LinkError& error) {
      link_.reset();
      const bool nobody_there = dynamic_cast<const link::ConnectError*>(&error) != nullptr;
      if (nobody_there && !broken && !was_connected_) throw;
      if (!broken) broken = Clock::now();
      if (patience_is_over(*broken)) throw;
    }
    std::this_thread::sleep_for(kRetryPause);
  }
}

v1::ExperimentInfo ExperimentClient::run(ExperimentFile file) {
  file.request.set_owner(owner_);
  file.request.set_user(server_.user);
  file.request.set_request_key(random_word());
  v1::ExperimentInfo info;
  try {
    with_link([&](link::Link& link) {
      was_connected_ = true;
      file.request.set_axis(axis_number(link.welcome().bench(), file.axis));
      upload_tables(link, file.request);
      info = link.run_experiment(file.request);
    });
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
  queued_ = info.id();
  return info;
}

v1::ExperimentInfo ExperimentClient::fetch(std::uint64_t id, bool recording, const Take& take,
                                           const std::function<std::uint64_t()>& next) {
  v1::ExperimentInfo info;
  Progress progress("experiment");
  bool cancelled = false;
  with_link([&](link::Link& link) {
    v1::FetchExperiment wanted;
    wanted.set_id(id);
    wanted.set_owner(owner_);
    wanted.set_from(next());
    wanted.set_recording(recording);
    info = link.begin_fetch(wanted);
    was_connected_ = true;
    const auto is_whole = [&] {
      return has_ended(info.state()) &&
             next() >= (recording ? info.recording_bytes() : info.rows() * info.decimation());
    };
    take(info, nullptr);
    // The server ends with one more ExperimentInfo, also where all data came at once.
    for (bool last = false; !last && !gave_up_; gave_up_ = !last && interrupted() && queued_ != id) {
      const v1::Envelope& message = link.next_of_fetch();
      if (message.has_experiment_data()) {
        take(info, &message.experiment_data());
        continue;
      }
      info = message.experiment_info();
      show(info, progress);
      last = is_whole();
      if (!last && queued_ == id && interrupted() && !cancelled) {
        cancelled = true;
        open_link(server_.link, subcommand_).cancel_experiment(id, owner_);
      }
    }
  });
  return info;
}

}  // namespace drivebench::command
