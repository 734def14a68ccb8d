#pragma once

#include <string_view>

namespace drivebench {

/// Sends a state ("READY=1" or "STOPPING=1") to the service manager, like sd_notify(3). Does nothing without
/// NOTIFY_SOCKET, that is unless a service of Type=notify started the program. Returns false if sending
/// failed.
bool notify_service_manager(std::string_view state) noexcept;

}  // namespace drivebench
