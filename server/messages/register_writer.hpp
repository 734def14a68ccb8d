#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "server/messages/device_message.hpp"

namespace drivebench {

/// Writes registers of Modbus servers on a thread of its own, one write after the other.
class RegisterWriter {
 public:
  /// Why a write has failed; empty: the device has confirmed it. Called on the thread of the writer.
  using Done = std::function<void(const std::string& problem)>;

  RegisterWriter() : thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void write(const RegisterMessage& message, Done done);
  /// Returns when every write so far is done: after at most a second for each.
  void wait();

 private:
  struct Job {
    RegisterMessage message;
    Done done;
  };

  void run(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Job> jobs_;
  bool is_busy_ = false;
  std::jthread thread_;  // the last member: it ends before the others go
};

}  // namespace drivebench
