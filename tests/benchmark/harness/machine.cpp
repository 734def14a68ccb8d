#include "tests/benchmark/harness/machine.hpp"

#include <fmt/core.h>
#include <stdlib.h>  // mkdtemp
#include <sys/resource.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>
#include <fstream>
#include <system_error>

namespace drivebench::speed {

std::int64_t now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1'000'000'000 + t.tv_nsec;
}

void check(bool good, const char* what) {
  if (!good) throw std::system_error(errno, std::generic_category(), what);
}

CpuPair cpu_pair() {
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof(allowed), &allowed) != 0) return {};
  CpuPair pair{.near = -1, .far = -1};
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (!CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) continue;
    if (pair.near < 0) pair.near = cpu;
    pair.far = cpu;  // the last one: the first serves most interrupts
  }
  return pair;
}

Pinned::Pinned(int cpu) {
  sched_getaffinity(0, sizeof(before_), &before_);
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(static_cast<std::size_t>(cpu), &only);
  if (sched_setaffinity(0, sizeof(only), &only) != 0) {
    throw std::system_error(errno, std::generic_category(), fmt::format("cannot pin to CPU {}", cpu));
  }
}

Pinned::~Pinned() {
  sched_setaffinity(0, sizeof(before_), &before_);
}

void give_way() {
  constexpr int kLowestPriority = 19;
  check(::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLowestPriority) == 0, "setpriority");
}

std::string machine_description() {
  std::string model = "unknown CPU";
  int cpus = 0;
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("processor")) ++cpus;
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) model = line.substr(colon + 2);
  }
  utsname system{};
  uname(&system);
#ifdef __clang__
  const char* const compiler = "";  // its version string says "Clang"
#else
  const char* const compiler = "g++ ";
#endif
  return fmt::format("{}, {} CPUs, Linux {}, {}{}", model, cpus, system.release, compiler, __VERSION__);
}

std::string today() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm date{};
  gmtime_r(&now, &date);
  return fmt::format("{:04}-{:02}-{:02}", date.tm_year + 1900, date.tm_mon + 1, date.tm_mday);
}

ScratchFolder::ScratchFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "drivebench-benchmark-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    throw std::system_error(errno, std::generic_category(), "cannot create " + name);
  }
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace drivebench::speed
