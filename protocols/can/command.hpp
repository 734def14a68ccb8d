#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "protocols/can/codec.hpp"

/// The content of commands, independent of the frames that carry them.
namespace drivebench::can {

/// The set-points of a command: voltages, duties or currents, depending on the mode.
struct CommandFields {
  std::uint64_t tick = 0;  ///< of the sample that the command answers
  unsigned mode = 0;
  unsigned lease = 0;
  unsigned legs_off = 0;
  double a = 0.0;
  double b = 0.0;
  double c = 0.0;      ///< wide axes only
  double field = 0.0;  ///< wide axes only
};

namespace command_detail {

/// The fields of commands in the order of the members of CommandFields.
inline constexpr auto kNames =
    std::to_array<std::string_view>({"tick", "mode", "lease", "legs_off", "u_a", "u_b", "u_c", "u_f"});

using Numbers = std::array<double, kNames.size()>;

/// The index of each of these fields in a message; kMaxFields: the message lacks it.
using FieldIndices = std::array<std::size_t, kNames.size()>;
inline constexpr auto kFieldIndices = [] {
  std::array<FieldIndices, kMessages.size()> all{};
  for (std::size_t row = 0; row < kMessages.size(); ++row) {
    for (std::size_t i = 0; i < kNames.size(); ++i) {
      std::size_t index = 0;
      const auto& fields = kMessages[row].fields;
      while (index < fields.size() && fields[index].name != kNames[i])
        ++index;
      all[row][i] = index < fields.size() ? index : kMaxFields;
    }
  }
  return all;
}();

inline const FieldIndices& indices_in(const MessageRow& row) noexcept {
  return kFieldIndices[static_cast<std::size_t>(&row - kMessages.data())];
}

}  // namespace command_detail

/// The set-points in the values of a command or a phase_command; `tick` holds only low bits.
inline CommandFields setpoints_in(const MessageRow& row, const Values& values) noexcept {
  command_detail::Numbers n{};
  const command_detail::FieldIndices& indices = command_detail::indices_in(row);
  for (std::size_t i = 0; i < n.size(); ++i)
    n[i] = indices[i] < kMaxFields ? values[indices[i]] : 0.0;
  return {.tick = static_cast<std::uint64_t>(n[0]),
          .mode = static_cast<unsigned>(n[1]),
          .lease = static_cast<unsigned>(n[2]),
          .legs_off = static_cast<unsigned>(n[3]),
          .a = n[4],
          .b = n[5],
          .c = n[6],
          .field = n[7]};
}

/// The frames of one command, in the order of sending: a wide axis takes two classic frames.
struct CommandFrames {
  std::array<Frame, 2> frame{};
  std::size_t count = 0;

  const Frame* begin() const noexcept { return frame.data(); }
  const Frame* end() const noexcept { return frame.data() + count; }
};

inline CommandFrames encode_command(const Profile& profile, std::uint32_t node, bool wide,
                                    const CommandFields& s) noexcept {
  const command_detail::Numbers n = {static_cast<double>(s.tick),
                                     static_cast<double>(s.mode),
                                     static_cast<double>(s.lease),
                                     static_cast<double>(s.legs_off),
                                     s.a,
                                     s.b,
                                     s.c,
                                     s.field};
  CommandFrames frames;
  for (const Message message : {Message::kPhaseCommand, Message::kCommand}) {
    const MessageRow* const row = find_message(message, profile.fd, wide);
    if (row == nullptr) continue;
    Values values{};
    const command_detail::FieldIndices& indices = command_detail::indices_in(*row);
    for (std::size_t i = 0; i < n.size(); ++i) {
      if (indices[i] < kMaxFields) values[indices[i]] = n[i];
    }
    frames.frame[frames.count++] = encode(*row, profile, node, values);
  }
  return frames;
}

}  // namespace drivebench::can
