#include "clients/command/common/line/version.hpp"

namespace drivebench::command {

const char* version_line() noexcept {
  return "drivebench " DRIVEBENCH_PROJECT_VERSION ", build " DRIVEBENCH_BUILD_ID;
}

const char* release_line() noexcept {
  return "drivebench " DRIVEBENCH_PROJECT_VERSION;
}

}  // namespace drivebench::command
