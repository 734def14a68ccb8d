#pragma once

namespace drivebench {

/// From now on a program that finds no memory says so and ends with this exit code, its recording readable as
/// after kill -9. Going on is not to be had: Protocol Buffers leave a message that cannot be destroyed when
/// an allocation in it fails, and Asio's coroutines terminate.
void end_without_memory(int exit_code) noexcept;

/// Stacks of all threads to come: of the system's 8 MiB nearly nothing is used, but all of it is locked in
/// real time.
void use_small_stacks() noexcept;

}  // namespace drivebench
