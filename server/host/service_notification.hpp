#pragma once

#include <string_view>

namespace drivebench {

/// Tells the service manager how this program stands, as sd_notify(3) does: "READY=1" or "STOPPING=1". A
/// program that was not started as a service of Type=notify has no NOTIFY_SOCKET, and nothing happens. Says
/// false if a manager waits and could not be told.
bool notify_service_manager(std::string_view state) noexcept;

}  // namespace drivebench
