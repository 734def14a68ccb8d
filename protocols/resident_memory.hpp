#pragma once

#include <unistd.h>

#include <cstdint>
#include <fstream>

namespace drivebench {

/// The memory of this process that is in RAM now [byte]; 0 if the kernel does not say.
inline std::uint64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t total = 0;
  std::uint64_t resident = 0;
  file >> total >> resident;
  return resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

}  // namespace drivebench
