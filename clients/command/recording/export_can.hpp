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

/// The frames of a run in the format of candump -l: the bench's frames of each sample and the accepted
/// commands. Heartbeats, requests and replies are not in a recording. The lease number of the commands is the
/// low bits of the owner number.
class CandumpText {
 public:
  /// The address gives interface, profile and the node id of the first axis.
  CandumpText(const link::CanAddress& address, bool is_lockstep)
      : address_(address), is_lockstep_(is_lockstep) {}

  /// Adds a sample; in the order of the recording.
  void add(std::uint32_t axis, const Sample& sample, double time_s);
  void add(const v1::Input& input, double time_s);
  /// To be called after the last sample.
  void finish();

  /// The text since the caller last cleared it.
  std::string& text() noexcept { return text_; }
  std::uint64_t frames() const noexcept { return frames_; }

 private:
  struct Before {
    std::uint64_t faults = 0;
    std::int64_t index_tick = -1;
    bool wide = false;  ///< the axis has shown a phase c, a field or Hall lines; later frames carry them
  };

  void put(can::Message message, std::uint32_t axis, const Sample& sample, double time_s);
  void put(const can::Frame& frame, double time_s);
  std::uint32_t node(std::uint32_t axis) const;
  /// Writes the SYNC of a tick after all its samples.
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
