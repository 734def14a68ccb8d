#pragma once

namespace drivebench::command {

/// "drivebench VERSION, build COMMIT".
const char* version_line() noexcept;

/// "drivebench VERSION".
const char* release_line() noexcept;

}  // namespace drivebench::command
