#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::speed {

/// Clients that read all their samples, on a thread of their own until this object goes.
class Viewers {
 public:
  Viewers(const std::string& address, int count);
  ~Viewers();
  Viewers(const Viewers&) = delete;
  Viewers& operator=(const Viewers&) = delete;

  /// Each has a sample every so many ticks from now on.
  void watch(std::uint32_t decimation);

  /// Whether one of them has lost its link.
  bool failed() const { return failed_.load(); }
  std::uint64_t seen() const { return seen_.load(); }
  std::uint64_t dropped() const { return dropped_.load(); }

 private:
  void read();

  std::vector<std::unique_ptr<link::Link>> links_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> failed_{false};
  std::atomic<std::uint64_t> seen_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::thread thread_;
};

/// The process that listens on a unix socket.
pid_t listener_of(const std::string& path);

/// Resident memory of a process [MiB].
double resident_mib(pid_t pid);

}  // namespace drivebench::speed
