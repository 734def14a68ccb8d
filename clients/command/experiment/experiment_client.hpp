#pragma once

#include <bench.pb.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "clients/command/common/session/link_choice.hpp"
#include "clients/command/experiment/experiment_file.hpp"
#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::command {

/// The server of experiments, and the user.
struct ExperimentServer {
  LinkChoice link{};
  std::string owner{};       ///< the secret that opens the data; empty: this user's secret, kept in a file
  std::string user{};        ///< a name that every client sees
  double patience_s = 30.0;  ///< the longest time without a link
};
/// The default server, with DRIVEBENCH_OWNER and USER.
ExperimentServer server_of_environment();

/// 128 random bits in hexadecimal digits.
std::string random_word();

bool has_ended(v1::ExperimentState state);

/// Experiments on a server. The client connects again after a broken link.
class ExperimentClient {
 public:
  /// `subcommand` is the client's name in the server's log.
  ExperimentClient(const ExperimentServer& server, std::string subcommand);

  const std::string& owner() const noexcept { return owner_; }
  std::uint64_t resumed() const noexcept { return resumed_; }
  bool gave_up() const noexcept { return gave_up_; }

  /// Runs the action on a link, and again after a broken link: it may run more than once. Throws like
  /// open_link() if the first link cannot be opened.
  void with_link(const std::function<void(link::Link&)>& action);

  /// Uploads tables and queues the request. Throws UsageError if the bench has no such axis.
  v1::ExperimentInfo run(ExperimentFile file);

  /// Receives the description of the experiment, and a piece of its data or null.
  using Take = std::function<void(const v1::ExperimentInfo&, const v1::ExperimentData*)>;
  /// Receives rows, or the recording, until the end; `next` gives the first that is missing. An interrupt
  /// cancels an experiment that run() has queued, and its data so far still come; for any other experiment
  /// it ends the receiving alone.
  v1::ExperimentInfo fetch(std::uint64_t id, bool recording, const Take& take,
                           const std::function<std::uint64_t()>& next);

 private:
  bool patience_is_over(std::chrono::steady_clock::time_point since) const;

  ExperimentServer server_;
  std::string subcommand_;
  std::string owner_;
  std::unique_ptr<link::Link> link_;
  bool was_connected_ = false;           // after the first connection the client waits for a silent server
  std::optional<std::uint64_t> queued_;  // by run()
  std::uint64_t resumed_ = 0;
  bool gave_up_ = false;
};

}  // namespace drivebench::command
