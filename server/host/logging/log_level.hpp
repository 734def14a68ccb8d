#pragma once

namespace drivebench {

enum class LogLevel { kDebug, kInfo, kWarn, kError, kOff };

}  // namespace drivebench
