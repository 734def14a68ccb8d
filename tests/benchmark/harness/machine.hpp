#pragma once

#include <sched.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>

namespace drivebench::speed {

std::int64_t now_ns() noexcept;

/// Throws std::system_error with errno unless `good`.
void check(bool good, const char* what);

/// Two CPUs this process may use; the same one twice if there is no other.
struct CpuPair {
  int near = 0;  ///< for this program: the client
  int far = 0;   ///< for the other end: the server

  bool operator==(const CpuPair&) const = default;
};
CpuPair cpu_pair();

/// Keeps the calling thread, and the processes it starts meanwhile, on one CPU as long as this object lives.
class Pinned {
 public:
  explicit Pinned(int cpu);
  ~Pinned();
  Pinned(const Pinned&) = delete;
  Pinned& operator=(const Pinned&) = delete;

 private:
  cpu_set_t before_{};
};

/// The calling thread gets the lowest priority.
void give_way();

/// Model and number of the CPUs, and the kernel: a figure needs them.
std::string machine_description();

/// `YYYY-MM-DD`, in UTC.
std::string today();

/// A new folder for the files of a measurement, removed with this object.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

}  // namespace drivebench::speed
