#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/link/can/can_address.hpp"
#include "protocols/can/frame.hpp"

namespace drivebench::link {

/// The identifiers that a link hears: those of the bench's frames, and that of its heartbeat in the other set
/// of default identifiers.
std::vector<std::uint32_t> heard_ids(const CanAddress& address);

/// The version in a heartbeat of this node that has its identifier in the other set; nothing for other
/// frames.
std::optional<unsigned> other_version_in(const can::Frame& frame, const can::Profile& profile,
                                         std::uint32_t node);

/// The version of the profile that the bench speaks, and the key of an address that makes both ends agree.
std::string other_version_text(unsigned version, const can::Profile& profile);

}  // namespace drivebench::link
