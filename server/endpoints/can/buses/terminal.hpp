#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/host/asio.hpp"

namespace drivebench::can {

/// A pseudo terminal at a link, which programs open like a serial device, one at a time.
class Terminal {
 public:
  explicit Terminal(asio::io_context& io) : poll_(io) {}
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  /// Removes the link.
  ~Terminal();

  /// Called with a descriptor for the program that has just opened the terminal; the callee owns it. The next
  /// program comes after release().
  std::function<void(int fd)> on_client;

  /// Creates the terminal and the link. Returns the problem with its cure; empty: none.
  std::string open(const std::string& link);
  /// To be called after the program has left: drops its unread bytes and waits for the next program.
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
