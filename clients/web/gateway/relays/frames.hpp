#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace drivebench::web {

/// The reason why a message of a browser is not whole frames of requests (protocols/framing.hpp); empty: it
/// is.
std::string_view problem_of_frames(std::span<const std::byte> message) noexcept;

}  // namespace drivebench::web
