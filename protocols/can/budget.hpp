#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocols/can/profile.hpp"

namespace drivebench::can {

/// Time of a data frame and the pause after it on the bus: without stuff bits, and with the most possible
/// ones.
struct FrameTime {
  double least_s = 0.0;
  double most_s = 0.0;
};
/// The data phase of an FD frame runs at `data_bit_rate`. Rates in bit/s.
FrameTime frame_time(std::size_t size, bool fd, bool extended, double bit_rate, double data_bit_rate);

/// The traffic on a bus while the bench runs in real time.
struct BusUse {
  std::size_t axes = 1;
  std::size_t wide_axes = 0;        ///< number of axes that are wide
  std::size_t sensing_axes = 0;     ///< number of wide axes with a tachometer or a resolver
  double period_s = 1e-3;           ///< of the bench
  double sample_every_ticks = 1.0;  ///< also of SYNC and of the controller's commands
  double state_every_ticks = 80.0;
  double heartbeat_ms = 100.0;  ///< of the bench and of the controllers; 0: none
  bool edges = false;           ///< one frame a tick for each axis: up to 26 edges
  double bit_rate = 1e6;
  double data_bit_rate = 5e6;
};

/// The share of the bus that a message takes, 0 to 1.
struct MessageLoad {
  const MessageRow* row;
  double frames_per_s;  ///< of all axes
  FrameTime time;
  double least_share;
  double most_share;
};

/// The load of a bus: the frames fit if the share is at most 1.
struct BusLoad {
  std::vector<MessageLoad> messages;  ///< the periodic messages, in order of the table
  double least_share = 0.0;
  double most_share = 0.0;
};

/// Computes the load of the periodic messages; fault, index, request and reply do not count.
BusLoad bus_load(const Profile& profile, const BusUse& use);

/// The load as a Markdown table with a line for the sum.
std::string load_text(const BusLoad& load);

}  // namespace drivebench::can
