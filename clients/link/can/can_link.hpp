#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "clients/link/can/can_bus.hpp"
#include "clients/link/common/axis_link.hpp"
#include "protocols/can/command.hpp"

namespace drivebench::link {

struct CanLinkOptions {
  std::chrono::milliseconds deadline{5000};  ///< for every answer
  std::chrono::milliseconds repeat_after{
      20};  ///< repeats a request or command without an answer, since frames can get lost
};

/// The link of a controller over the native CAN profile. Samples have no truth; state, faults and counters
/// are those of the last frame that carried them. The link extends ticks and counts from their low bits.
class CanLink final : public AxisLink {
 public:
  /// Connects and waits for the bench's heartbeat. Throws ConnectError.
  explicit CanLink(const CanAddress& address, const CanLinkOptions& options = {});
  /// Uses an open bus; `name` is its name in errors and in bench().
  CanLink(std::unique_ptr<CanBus> bus, const CanAddress& address, std::string name,
          const CanLinkOptions& options = {});
  /// Releases the axis if it is still held, without waiting for the answer.
  ~CanLink() override;

  const v1::BenchDescription& bench() const noexcept override { return bench_; }
  std::uint32_t axis() const noexcept override { return 0; }
  SignalMask known() const noexcept override { return known_; }

  void acquire() override;
  void release() override;
  void clear_faults() override;
  const Sample& newest() override;
  const Sample& exchange(const AxisCommand& command) override;
  void write_parameter(std::string_view name, double value) override;
  bool can_set_load() const noexcept override { return false; }
  void set_load(const LoadChange& change) override;

 private:
  using Clock = CanBus::Clock;

  struct Reply {
    can::Result result;
    unsigned lease;
  };

  /// Takes a frame if one comes in time.
  bool receive(Clock::time_point until);
  void take(const can::MessageRow& row, const can::Values& values);
  void take_heartbeat(const can::Values& values);
  void take_reply(const can::Values& values);
  void take_sample();
  can::CommandFrames frames_of(const AxisCommand& command) const;
  void take_sync_tick(std::uint32_t tick);
  void send_request(can::Request request);
  Reply ask(can::Request request);
  /// Receives until `done`, and calls `repeat` after each `repeat_after` without an answer.
  template <class Done, class Repeat>
  void await(const std::string& what, Done done, Repeat repeat);
  void check_replies();
  bool is_lockstep() const noexcept { return bench_.mode() == v1::MODE_LOCKSTEP; }

  std::unique_ptr<CanBus> bus_;
  can::Profile profile_;
  std::uint32_t node_;
  std::string name_;
  CanLinkOptions options_;
  v1::BenchDescription bench_;
  SignalMask known_ = 0;
  std::uint32_t controller_;
  unsigned lease_ = 0;

  Sample coming_;  // classic: holds the encoder frame until the currents frame comes
  Sample sample_;
  bool has_encoder_ = false;  // coming_ has an encoder frame
  bool has_phases_ = false;   // wide axis: coming_ has a phases frame
  bool has_sample_ = false;
  bool has_state_ = false;
  bool has_counters_ = false;
  can::FrameProblem misfit_ = can::FrameProblem::kNone;  // the last problem of a frame of the bench
  unsigned other_version_ = 0;  // of a bench that sends its heartbeat with the identifiers of the other set
  std::uint64_t commanded_tick_ = 0;
  std::optional<can::Result> command_result_;    // of the command for it, if the bench refused it
  can::Request asked_ = can::Request::kCommand;  // the request that waits for an answer; kCommand: none
  std::optional<Reply> reply_;
};

}  // namespace drivebench::link
