#include "protocols/can/budget.hpp"

#include <array>
#include <cstdio>
#include <string_view>

#include "protocols/can/table_text.hpp"

namespace drivebench::can {
namespace {

// Bits of a frame, ISO 11898-1:2015. A stuff bit follows five equal bits and is the first of the next five: n
// bits take at most (n-1)/4 stuff bits.
constexpr std::size_t most_stuff_bits(std::size_t bits) {
  return (bits - 1) / 4;
}

/// CRC and ACK delimiter, ACK, end of frame, pause between frames: never stuffed.
constexpr std::size_t kTailBits = 1 + 1 + 1 + 7 + 3;

/// Start, identifier (and its extension with SRR), RTR, IDE, reserved bit; with data length and CRC.
constexpr std::size_t classic_bits(std::size_t size, bool extended) {
  const std::size_t head = extended ? 1 + 11 + 1 + 1 + 18 + 1 + 2 : 1 + 11 + 1 + 1 + 1;
  return head + 4 + 8 * size + 15;
}

/// Start to bit rate switch of an FD frame.
constexpr std::size_t fd_head_bits(bool extended) {
  return extended ? 1 + 11 + 1 + 1 + 18 + 1 + 1 + 1 + 1 : 1 + 11 + 1 + 1 + 1 + 1 + 1;
}

/// Stuff count and CRC with their fixed stuff bits: one before the first bit and one after every fourth.
constexpr std::size_t fd_check_bits(std::size_t size) {
  const std::size_t bits = 4 + (size <= 16 ? 17 : 21);
  return bits + 1 + bits / 4;
}

double rate_of(const MessageRow& row, const Profile& profile, const BusUse& use) {
  const auto wide_axes = static_cast<double>(use.wide_axes);
  const double narrow_axes = static_cast<double>(use.axes) - wide_axes;
  const double axes = row.width == Width::kNarrow ? narrow_axes
                      : row.width == Width::kWide ? wide_axes
                                                  : narrow_axes + wide_axes;
  const double samples_per_s = 1.0 / (use.period_s * use.sample_every_ticks);
  const double states_per_s = 1.0 / (use.period_s * use.state_every_ticks);
  switch (row.message) {
    case Message::kSync:
      return samples_per_s;
    case Message::kCurrents:
    case Message::kSensors:
    case Message::kCommand:
    case Message::kEncoder:
    case Message::kPhaseCommand:
    case Message::kPhases:
      return axes * samples_per_s;
    case Message::kState:
    case Message::kCounters:
      return axes * states_per_s;
    case Message::kDetails: {  // each sample of an axis with speed sensors brings their page
      const auto sensing_axes = static_cast<double>(use.sensing_axes);
      return profile.fd ? axes * states_per_s
                        : axes * double{kPages - 1} * states_per_s + sensing_axes * samples_per_s;
    }
    case Message::kEdges:
      return use.edges ? axes / use.period_s : 0.0;
    case Message::kControllerHeartbeat:
    case Message::kHeartbeat:
      return use.heartbeat_ms > 0 ? axes * 1e3 / use.heartbeat_ms : 0.0;
    case Message::kFault:
    case Message::kRequest:
    case Message::kReply:
    case Message::kIndex:
      break;
  }
  return 0.0;
}

std::string load_line(std::string_view name, double frames_per_s, const std::string& time, double least,
                      double most) {
  std::array<char, 160> line{};
  std::snprintf(line.data(), line.size(), "| %.*s | %.1f | %s | %.1f to %.1f |\n",
                static_cast<int>(name.size()), name.data(), frames_per_s, time.c_str(), 100.0 * least,
                100.0 * most);
  return line.data();
}

}  // namespace

FrameTime frame_time(std::size_t size, bool fd, bool extended, double bit_rate, double data_bit_rate) {
  if (!fd) {
    const std::size_t stuffed = classic_bits(size, extended);
    const auto least = static_cast<double>(stuffed + kTailBits);
    return {least / bit_rate, (least + static_cast<double>(most_stuff_bits(stuffed))) / bit_rate};
  }
  const std::size_t head = fd_head_bits(extended);
  const std::size_t data = 1 + 4 + 8 * size;  // error state, length, data
  const std::size_t head_stuff = most_stuff_bits(head);
  const std::size_t data_stuff = most_stuff_bits(head + data) - head_stuff;
  const double least_s = static_cast<double>(head + kTailBits) / bit_rate +
                         static_cast<double>(data + fd_check_bits(size)) / data_bit_rate;
  return {least_s, least_s + static_cast<double>(head_stuff) / bit_rate +
                       static_cast<double>(data_stuff) / data_bit_rate};
}

BusLoad bus_load(const Profile& profile, const BusUse& use) {
  BusLoad load;
  for (const MessageRow& row : kMessages) {
    const double rate = is_in(row, profile.fd) ? rate_of(row, profile, use) : 0.0;
    if (rate == 0.0) continue;
    const FrameTime time =
        frame_time(row.size, profile.fd, profile.extended, use.bit_rate, use.data_bit_rate);
    load.messages.push_back({&row, rate, time, rate * time.least_s, rate * time.most_s});
    load.least_share += load.messages.back().least_share;
    load.most_share += load.messages.back().most_share;
  }
  return load;
}

std::string load_text(const BusLoad& load) {
  std::string text = "| message | frames/s | time of one [us] | share of the bus [%] |\n|---|---|---|---|\n";
  double frames_per_s = 0.0;
  for (const MessageLoad& part : load.messages) {
    const std::string time =
        number_text(1e6 * part.time.least_s, 4) + " to " + number_text(1e6 * part.time.most_s, 4);
    text += load_line(part.row->name, part.frames_per_s, time, part.least_share, part.most_share);
    frames_per_s += part.frames_per_s;
  }
  return text + load_line("all", frames_per_s, "", load.least_share, load.most_share);
}

}  // namespace drivebench::can
