#pragma once

#include <string_view>

namespace drivebench {

/// The commit that this program was built from.
std::string_view build_id() noexcept;

}  // namespace drivebench
