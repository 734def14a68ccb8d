#include "clients/command/experiment/experiment.hpp"

#include <fmt/core.h>

#include <stdexcept>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/command/experiment/experiment_client.hpp"
#include "clients/command/experiment/experiment_data.hpp"
#include "clients/command/experiment/experiment_json.hpp"
#include "protocols/document.hpp"

namespace drivebench::command {
namespace {

constexpr const char* kName = "experiment";

bool is_recording(const std::string& file) {
  return file.ends_with(".mcap");
}

void check_out_file(const ExperimentOptions& options) {
  check_suffix(options.out_file, {".csv", ".txt", ".mcap"});
}

v1::ExperimentInfo fetch_into(ExperimentClient& client, const ExperimentOptions& options, std::uint64_t id,
                              bool standard_output) {
  const bool recording = is_recording(options.out_file);
  DataWriter data(recording ? "" : options.out_file, standard_output && !recording);
  v1::ExperimentInfo info = client.fetch(
      id, false,
      [&](const v1::ExperimentInfo& about, const v1::ExperimentData* piece) {
        data.describe(about);
        if (piece != nullptr) data.take(*piece);
      },
      [&] { return data.next_tick(); });
  data.flush();
  if (!recording || info.recording_bytes() == 0 || client.gave_up()) return info;
  RecordingDownload out(options.out_file);
  info = client.fetch(
      id, true,
      [&](const v1::ExperimentInfo&, const v1::ExperimentData* piece) {
        out.describe();
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
  check_out_file(options);
  ExperimentFile file = load(options.file);
  ExperimentClient client(options.server, kName);
  catch_interrupts();
  v1::ExperimentInfo info = client.run(std::move(file));
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
  ExperimentClient client(options.server, kName);
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
  check_out_file(options);
  ExperimentClient client(options.server, kName);
  catch_interrupts();
  const v1::ExperimentInfo info = fetch_into(client, options, options.id, true);
  if (client.gave_up()) {
    throw std::runtime_error(
        fmt::format("interrupted; what came is written, and experiment {} is not cancelled", options.id));
  }
  return tell(options, info, client.resumed());
}

int run_experiment_cancel(const ExperimentOptions& options) {
  ExperimentClient client(options.server, kName);
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
