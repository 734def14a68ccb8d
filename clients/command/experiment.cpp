// drivebench experiment: what the server runs on a bench of its own.
#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <thread>

#include "clients/command/commands.hpp"
#include "clients/command/experiment_data.hpp"
#include "clients/command/experiment_file.hpp"
#include "clients/command/json.hpp"
#include "clients/command/session.hpp"
#include "protocols/document.hpp"

namespace drivebench::command {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kRetryPause = std::chrono::milliseconds(200);

/// 128 bits that nobody guesses.
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

/// The secret of this user: made once, kept where only he can read it.
std::string own_secret() {
  const char* const base = std::getenv("XDG_CONFIG_HOME");
  const char* const home = std::getenv("HOME");
  if (base == nullptr && home == nullptr)
    throw UsageError("--owner is needed: there is no HOME to keep it in");
  const std::filesystem::path folder =
      (base != nullptr ? std::filesystem::path(base) : std::filesystem::path(home) / ".config") /
      "drivebench";
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

bool has_ended(v1::ExperimentState state) {
  return state > v1::EXPERIMENT_STATE_RUNNING;
}

/// An experiment and a link that is made anew when it breaks.
class Client {
 public:
  explicit Client(const ExperimentOptions& options)
      : options_(options), owner_(options.owner.empty() ? own_secret() : options.owner) {}

  const std::string& owner() const noexcept { return owner_; }
  std::uint64_t resumed() const noexcept { return resumed_; }

  /// Does something with a link, again after the link broke: it must bear being done twice.
  template <class Action>
  void with_link(Action action) {
    std::optional<Clock::time_point> broken;
    for (;;) {
      try {
        if (!link_) link_.emplace(options_.link.address, link_options());
        if (broken) ++resumed_;
        broken.reset();
        return action(*link_);
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
  /// Beside a fetch that is going on.
  void cancel(std::uint64_t id) {
    link::Link(options_.link.address, link_options()).cancel_experiment(id, owner_);
  }
  /// From now on a server that does not answer is waited for.
  void connected() noexcept { was_connected_ = true; }

 private:
  link::LinkOptions link_options() const {
    return {.client = "drivebench experiment", .token = options_.link.token};
  }

  bool patience_is_over(Clock::time_point since) const {
    return std::chrono::duration<double>(Clock::now() - since).count() > options_.patience_s || interrupted();
  }

  const ExperimentOptions& options_;
  std::string owner_;
  std::optional<link::Link> link_;
  bool was_connected_ = false;
  std::uint64_t resumed_ = 0;
};

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

bool is_recording(const std::string& file) {
  return file.ends_with(".mcap");
}

void show(const v1::ExperimentInfo& info, Progress& progress) {
  const double part =
      info.ticks() == 0 ? 0.0 : static_cast<double>(info.tick()) / static_cast<double>(info.ticks());
  progress.update(part, info.position() > 0 ? fmt::format("waiting, {} in the queue", info.position())
                                            : word_of(info.state()));
}

/// Receives until the end. `take` gets the data, `next` says from where on they are wanted.
template <class Take, class Next>
v1::ExperimentInfo fetch(Client& client, std::uint64_t id, bool recording, Take take, Next next) {
  v1::ExperimentInfo info;
  Progress progress("experiment");
  bool cancelled = false;
  client.with_link([&](link::Link& link) {
    v1::FetchExperiment wanted;
    wanted.set_id(id);
    wanted.set_owner(client.owner());
    wanted.set_from(next());
    wanted.set_recording(recording);
    info = link.begin_fetch(wanted);
    client.connected();
    const auto is_whole = [&] {
      return has_ended(info.state()) &&
             next() >= (recording ? info.recording_bytes() : info.rows() * info.decimation());
    };
    take(info, nullptr);
    // The server ends with one more word, also if everything was there at once.
    for (bool last = false; !last;) {
      const v1::Envelope& message = link.next_of_fetch();
      if (message.has_experiment_data()) {
        take(info, &message.experiment_data());
        continue;
      }
      info = message.experiment_info();
      show(info, progress);
      last = is_whole();
      if (!last && interrupted() && !cancelled) {
        cancelled = true;
        client.cancel(id);
      }
    }
  });
  return info;
}

v1::ExperimentInfo fetch_into(Client& client, const ExperimentOptions& options, std::uint64_t id,
                              bool standard_output) {
  const bool recording = is_recording(options.out_file);
  DataWriter data(recording ? "" : options.out_file, standard_output && !recording);
  v1::ExperimentInfo info = fetch(
      client, id, false,
      [&](const v1::ExperimentInfo& about, const v1::ExperimentData* piece) {
        data.describe(about);
        if (piece != nullptr) data.take(*piece);
      },
      [&] { return data.next_tick(); });
  data.flush();
  if (!recording || info.recording_bytes() == 0) return info;
  RecordingWriter out(options.out_file);
  info = fetch(
      client, id, true,
      [&](const v1::ExperimentInfo&, const v1::ExperimentData* piece) {
        if (piece != nullptr) out.take(*piece);
      },
      [&] { return out.bytes(); });
  out.flush();
  return info;
}

int tell(const ExperimentOptions& options, const v1::ExperimentInfo& info, std::uint64_t resumed) {
  if (options.json) {
    fmt::print("{}\n", experiment_json(info, options.out_file, resumed));
  } else {
    fmt::print(stderr, "experiment {}: {}{}{}; {} rows{}; {}; state hash {:016x}\n", info.id(),
               word_of(info.state()), info.reason().empty() ? "" : ", ", info.reason(), info.rows(),
               options.out_file.empty() ? "" : " in " + options.out_file, info.verdict().sentence(),
               info.verdict().state_hash());
  }
  const bool good =
      info.state() == v1::EXPERIMENT_STATE_COMPLETED || info.state() == v1::EXPERIMENT_STATE_STOPPED;
  return good ? kExitOk : kExitFailed;
}

ExperimentFile load(const std::string& file) {
  try {
    return load_experiment(file);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

}  // namespace

int run_experiment_run(const ExperimentOptions& options) {
  ExperimentFile file = load(options.file);
  Client client(options);
  catch_interrupts();
  file.request.set_owner(client.owner());
  file.request.set_user(options.user);
  file.request.set_request_key(random_word());
  v1::ExperimentInfo info;
  try {
    client.with_link([&](link::Link& link) {
      client.connected();
      file.request.set_axis(axis_number(link.welcome().bench(), file.axis));
      upload_tables(link, file.request);
      info = link.run_experiment(file.request);
    });
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
  if (options.detach) {
    if (options.json) {
      fmt::print("{}\n", experiment_json(info, "", client.resumed()));
    } else {
      fmt::print("experiment {}\n", info.id());
    }
    return kExitOk;
  }
  if (!options.json) fmt::print(stderr, "experiment {}, {}\n", info.id(), word_of(info.state()));
  info = fetch_into(client, options, info.id(), false);
  return tell(options, info, client.resumed());
}

int run_experiment_list(const ExperimentOptions& options) {
  Client client(options);
  v1::ExperimentList list;
  client.with_link([&](link::Link& link) { list = link.list_experiments(client.owner()); });
  if (options.json) {
    fmt::print("{}\n", experiments_json(list));
    return kExitOk;
  }
  fmt::print("{:>6}  {:<10} {:>5}  {:<16} {:>10}  {}\n", "id", "state", "queue", "user", "rows", "label");
  for (const v1::ExperimentInfo& info : list.experiments()) {
    const bool ours = info.period_s() > 0.0;
    fmt::print("{:>6}  {:<10} {:>5}  {:<16} {:>10}  {}\n", info.id(), word_of(info.state()),
               info.position() > 0 ? std::to_string(info.position()) : "", info.user(),
               ours ? std::to_string(info.rows()) : "", ours ? info.label() : "(not yours)");
  }
  return kExitOk;
}

int run_experiment_fetch(const ExperimentOptions& options) {
  Client client(options);
  catch_interrupts();
  const v1::ExperimentInfo info = fetch_into(client, options, options.id, true);
  return tell(options, info, client.resumed());
}

int run_experiment_cancel(const ExperimentOptions& options) {
  Client client(options);
  v1::ExperimentInfo info;
  client.with_link([&](link::Link& link) { info = link.cancel_experiment(options.id, client.owner()); });
  if (options.json) {
    fmt::print("{}\n", experiment_json(info, "", 0));
  } else {
    fmt::print("experiment {}: {}\n", info.id(),
               has_ended(info.state()) ? word_of(info.state()) : std::string("will end"));
  }
  return kExitOk;
}

}  // namespace drivebench::command
