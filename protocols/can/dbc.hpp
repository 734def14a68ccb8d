#pragma once

#include <span>
#include <string>
#include <string_view>

#include "protocols/can/budget.hpp"
#include "protocols/can/profile.hpp"
#include "protocols/can/table_text.hpp"

namespace drivebench::can {

/// The messages of these axes as a DBC file: message AXIS_MESSAGE with a signal for each field. Names are
/// identifiers of at most 32 characters. A set-point is one signal for each quantity, multiplexed by the
/// mode. The periodic messages have their cycle time in real time, in milliseconds and parts of them
/// (attribute GenMsgCycleTime).
std::string dbc_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes,
                     std::span<const MessageLoad> periodic = {}, std::span<const BitWord> words = {});

}  // namespace drivebench::can
