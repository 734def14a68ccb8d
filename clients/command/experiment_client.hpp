#pragma once

#include <bench.pb.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "clients/command/commands.hpp"
#include "clients/command/experiment_file.hpp"
#include "clients/link/tcp_link.hpp"

namespace drivebench::command {

/// 128 bits that nobody guesses.
std::string random_word();

bool has_ended(v1::ExperimentState state);

/// Experiments on a server, over a link that is made anew when it breaks.
class ExperimentClient {
 public:
  /// Of the options counts who asks and where: link, owner (empty: the secret of this user), user and
  /// patience.
  ExperimentClient(const ExperimentOptions& options, std::string name);

  const std::string& owner() const noexcept { return owner_; }
  std::uint64_t resumed() const noexcept { return resumed_; }

  /// Does something with a link, again after the link broke: it must bear being done twice.
  void with_link(const std::function<void(link::Link&)>& action);

  /// Uploads tables and queues the request. Throws UsageError if the bench has no such axis.
  v1::ExperimentInfo run(ExperimentFile file);

  /// Gets what the server says about the experiment, and null or a piece of its data.
  using Take = std::function<void(const v1::ExperimentInfo&, const v1::ExperimentData*)>;
  /// Receives rows, or the recording, until the end; `next` says from where on they are wanted. When this
  /// process is interrupted the experiment is cancelled, and what there is of it received.
  v1::ExperimentInfo fetch(std::uint64_t id, bool recording, const Take& take,
                           const std::function<std::uint64_t()>& next);

 private:
  link::LinkOptions link_options() const;
  bool patience_is_over(std::chrono::steady_clock::time_point since) const;

  ExperimentOptions options_;
  std::string name_;
  std::string owner_;
  std::optional<link::Link> link_;
  bool was_connected_ = false;  // from now on a server that does not answer is waited for
  std::uint64_t resumed_ = 0;
};

}  // namespace drivebench::command
