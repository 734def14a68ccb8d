#pragma once

#include <string>
#include <string_view>

namespace drivebench {

/// The commit that this program was built from.
std::string_view build_id() noexcept;

/// The version of drivebench, as MAJOR.MINOR.PATCH.
std::string_view project_version() noexcept;

/// Program and build, as recordings name them.
inline std::string recorder_name() {
  return "drivebench " + std::string(build_id());
}

}  // namespace drivebench
