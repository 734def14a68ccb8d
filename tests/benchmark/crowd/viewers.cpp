#include "tests/benchmark/crowd/viewers.hpp"

#include <fmt/core.h>
#include <sys/socket.h>

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>

#include "tests/benchmark/harness/machine.hpp"

namespace drivebench::speed {

using namespace std::chrono_literals;

Viewers::Viewers(const std::string& address, int count) {
  for (int i = 0; i < count; ++i)
    links_.push_back(std::make_unique<link::Link>(address));
}

void Viewers::watch(std::uint32_t decimation) {
  for (const auto& each : links_)
    each->subscribe(0, decimation);
  thread_ = std::thread([this] {
    try {
      read();
    } catch (const std::exception& error) {
      fmt::print(stderr, "a viewer: {}\n", error.what());
      failed_.store(true);
    }
  });
}

Viewers::~Viewers() {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
}

void Viewers::read() {
  // They stand for other computers: no measured thread may wait for them.
  give_way();
  while (!stop_.load()) {
    for (const auto& viewer : links_) {
      while (const auto samples = viewer->next_samples(0ms)) {
        seen_ += static_cast<std::uint64_t>(samples->samples_size());
        dropped_ += samples->dropped();
      }
    }
    std::this_thread::sleep_for(5ms);
  }
}

pid_t listener_of(const std::string& path) {
  const link::FileDescriptor socket = link::connect_to({.host = {}, .port = {}, .path = path}, 5s);
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (::getsockopt(socket.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
    throw std::system_error(errno, std::generic_category(), "SO_PEERCRED");
  }
  return peer.pid;
}

double resident_mib(pid_t pid) {
  std::ifstream status(fmt::format("/proc/{}/status", pid));
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stod(line.substr(6)) / 1024.0;
  }
  throw std::runtime_error("the server has ended");
}

}  // namespace drivebench::speed
