#include "server/host/build_id.hpp"

namespace drivebench {

std::string_view build_id() noexcept {
  return DRIVEBENCH_BUILD_ID;
}

std::string_view project_version() noexcept {
  return DRIVEBENCH_PROJECT_VERSION;
}

}  // namespace drivebench
