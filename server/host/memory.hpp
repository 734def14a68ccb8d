#pragma once

namespace drivebench {

/// Makes a failed allocation print a line and end the program with this exit code; its recording stays
/// readable as after kill -9. The program cannot go on: after a failed allocation a Protocol Buffers message
/// cannot be destroyed, and Asio's coroutines terminate.
void end_without_memory(int exit_code) noexcept;

/// Sets a small stack size for threads created later. A real-time server locks whole stacks, and threads use
/// little of the default 8 MiB.
void use_small_stacks() noexcept;

}  // namespace drivebench
