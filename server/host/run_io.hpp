#pragma once

#include <chrono>

#include "server/host/asio.hpp"

namespace drivebench {

/// Runs what comes at the sockets and timers, on this thread, until `io` is stopped. After each piece of work
/// the thread looks for the next one for so long before it sleeps: what comes meanwhile need not wake it, and
/// costs a system call for each look. Throws what a handler throws.
void run_io(asio::io_context& io, std::chrono::microseconds spin);

}  // namespace drivebench
