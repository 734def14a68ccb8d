#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/host/asio.hpp"

namespace drivebench::can {

/// A pseudo terminal that programs open like a serial device, one at a time, by a link at a path.
class Terminal {
 public:
  explicit Terminal(asio::io_context& io) : poll_(io) {}
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  /// Removes the link.
  ~Terminal();

  /// Takes over a descriptor for what a program writes and reads that has just opened the terminal. The next
  /// one comes after release().
  std::function<void(int fd)> on_client;

  /// Makes the terminal and the link; what hinders it, with the cure, or nothing.
  std::string open(const std::string& link);
  /// The program has gone: clears what it has left and waits for the next.
  void release();

 private:
  std::string make_link();
  bool renew();
  void poll_later();

  ServerTimer poll_;
  int fd_ = -1;
  std::string device_;
  std::string link_;
  std::shared_ptr<const bool> alive_ =
      std::make_shared<const bool>();  ///< for handlers that outlive the object
};

}  // namespace drivebench::can
