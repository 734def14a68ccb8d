#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "clients/link/can/can_address.hpp"
#include "protocols/can/frame.hpp"
#include "protocols/can/table.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench::command {

/// The frames of a run as candump -l writes them: what the bench sends of each sample and the commands that
/// it took. Heartbeats, requests and replies are not in a recording. The lease number of the commands is the
/// low bits of the session's number.
class CandumpText {
 public:
  /// Interface, profile and the node id of the first axis are the address's.
  CandumpText(const link::CanAddress& address, bool is_lockstep)
      : address_(address), is_lockstep_(is_lockstep) {}

  /// In the order of the recording.
  void add(std::uint32_t axis, const Sample& sample, double time_s);
  void add(const v1::Input& input, double time_s);
  /// After the last sample.
  void finish();

  /// What has been written since it was last emptied.
  std::string& text() noexcept { return text_; }
  std::uint64_t frames() const noexcept { return frames_; }

 private:
  struct Before {
    std::uint64_t faults = 0;
    std::int64_t index_tick = -1;
    bool wide = false;  ///< it has shown a phase c, a field or Hall lines: from then on its frames carry them
  };

  void put(can::Message message, std::uint32_t axis, const Sample& sample, double time_s);
  void put(const can::Frame& frame, double time_s);
  std::uint32_t node(std::uint32_t axis) const;
  /// Every sample of a tick goes before its SYNC.
  void end_tick();

  link::CanAddress address_;
  bool is_lockstep_;
  std::string text_;
  std::uint64_t frames_ = 0;
  std::map<std::uint32_t, Before> before_;  // by axis
  std::optional<std::uint64_t> open_tick_;
  double open_time_s_ = 0.0;
};

}  // namespace drivebench::command
