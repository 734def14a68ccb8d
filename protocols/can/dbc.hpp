#pragma once

#include <span>
#include <string>
#include <string_view>

#include "protocols/can/profile.hpp"

namespace drivebench::can {

/// The messages of these axes as a DBC file: message AXIS_MESSAGE with a signal for each field. Names are
/// identifiers of at most 32 characters.
std::string dbc_text(std::string_view bench, const Profile& profile, std::span<const BusAxis> axes);

}  // namespace drivebench::can
