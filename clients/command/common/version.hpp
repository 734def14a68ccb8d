#pragma once

namespace drivebench::command {

/// "drivebench VERSION, build COMMIT".
const char* version_line() noexcept;

}  // namespace drivebench::command
