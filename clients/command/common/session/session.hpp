#pragma once

#include <bench.pb.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "clients/command/common/session/link_choice.hpp"
#include "clients/link/common/axis_link.hpp"
#include "clients/link/tcp/tcp_axis.hpp"
#include "clients/reference/fault_text.hpp"
#include "protocols/signals/sample.hpp"

/// Helpers of the subcommands that talk to a bench.
namespace drivebench::command {

/// Connects as `drivebench SUBCOMMAND`. Throws NotLetIn, and UsageError for a can: or modbus: link.
link::Link open_link(const LinkChoice& choice, std::string_view subcommand);

/// The axis with this number or name.
std::optional<std::uint32_t> find_axis(const v1::BenchDescription& bench, std::string_view choice);
/// The axis with this number or name; otherwise throws UsageError with the list of axes.
std::uint32_t axis_number(const v1::BenchDescription& bench, std::string_view choice);

/// Connects to one axis over the transport of the address: tcp, tls, unix, shm, inproc, can or modbus.
/// Addresses of the latter two name the axis, so that `axis` must be its default "0". As open_link()
/// otherwise.
std::unique_ptr<link::AxisLink> open_axis(const LinkChoice& choice, std::string_view axis,
                                          std::string_view subcommand);

using link::plain;
using reference::fault_names;
using reference::injected_names;
using reference::latched_faults;
using reference::latched_text;
using reference::name_of_state;

/// Makes the first SIGINT or SIGTERM only set interrupted(); the second one ends the process.
void catch_interrupts();
bool interrupted() noexcept;

/// The progress of an operation longer than a second, as a line on standard error: redrawn in a terminal,
/// else every 5 s.
class Progress {
 public:
  explicit Progress(std::string what) : what_(std::move(what)) {}
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(double fraction, std::string_view doing);

 private:
  using Clock = std::chrono::steady_clock;
  std::string what_;
  Clock::time_point started_ = Clock::now();
  Clock::time_point shown_ = started_;
  bool drawn_ = false;
};

}  // namespace drivebench::command
