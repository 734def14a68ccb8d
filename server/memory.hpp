#pragma once

namespace drivebench {

/// While this lives, a program that finds no memory says so and ends with this exit code: half a start is
/// worth nothing, and not everything that it uses can be left in the middle. Later std::bad_alloc ends
/// whatever asked for memory.
class NoStartWithoutMemory {
 public:
  explicit NoStartWithoutMemory(int exit_code) noexcept;
  ~NoStartWithoutMemory();
  NoStartWithoutMemory(const NoStartWithoutMemory&) = delete;
  NoStartWithoutMemory& operator=(const NoStartWithoutMemory&) = delete;
};

/// Stacks of all threads to come: of the system's 8 MiB nearly nothing is used, but all of it is locked in
/// real time.
void use_small_stacks() noexcept;

}  // namespace drivebench
