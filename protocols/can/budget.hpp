#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "protocols/can/profile.hpp"

namespace drivebench::can {

/// What a bench sends over udp_multicast at most; beyond it the buffers of receivers lose datagrams.
inline constexpr double kMulticastFramesPerS = 8000.0;

/// How long a data frame and the pause after it keep the bus: without a stuff bit, and with as many as there
/// can be.
struct FrameTime {
  double least_s = 0.0;
  double most_s = 0.0;
};
/// An FD frame changes to `data_bit_rate` for its data. Rates in bit/s.
FrameTime frame_time(std::size_t size, bool fd, bool extended, double bit_rate, double data_bit_rate);

/// What is sent on a bus when the bench runs in real time.
struct BusUse {
  std::size_t axes = 1;
  std::size_t wide_axes = 0;        ///< how many of them are wide,
  std::size_t sensing_axes = 0;     ///< and have a tachometer or a resolver
  double period_s = 1e-3;           ///< of the bench
  double sample_every_ticks = 1.0;  ///< also of SYNC, and of the commands that answer
  double state_every_ticks = 80.0;
  double heartbeat_ms = 100.0;  ///< of the bench, and of the controllers; 0: none
  bool edges = false;           ///< one frame a tick for each axis: up to 26 edges
  double bit_rate = 1e6;
  double data_bit_rate = 5e6;
};

/// A message's part of the bus. Shares are of 1.
struct MessageLoad {
  const MessageRow* row;
  double frames_per_s;  ///< of all axes
  FrameTime time;
  double least_share;
  double most_share;
};

/// What must fit: above 1 it does not.
struct BusLoad {
  std::vector<MessageLoad> messages;  ///< of those that come all the time, in order of the table
  double least_share = 0.0;
  double most_share = 0.0;
};

/// Messages that come now and then (fault, index, request, reply) are not counted.
BusLoad bus_load(const Profile& profile, const BusUse& use);

/// As a Markdown table with a line for the sum.
std::string load_text(const BusLoad& load);

}  // namespace drivebench::can
