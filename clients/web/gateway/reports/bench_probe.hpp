#pragma once

#include <bench.pb.h>

#include <chrono>
#include <memory>
#include <string>

#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::web {

/// What the gateway knows of the bench. With a problem the rest is empty.
struct Reading {
  std::string problem{};  ///< why the bench gives no status; empty: it does
  v1::BenchDescription bench{};
  std::string build_id{};
  v1::Status status{};
};

/// The gateway's own session with the bench, for its reports; for one thread. It connects when it is asked
/// and again after a failure.
class BenchProbe {
 public:
  BenchProbe(std::string address, std::string token)
      : address_(std::move(address)), token_(std::move(token)) {}

  /// At most a quarter of a second old, so that no crowd of readers becomes a crowd at the bench.
  const Reading& read();

 private:
  using Clock = std::chrono::steady_clock;

  Reading ask();

  std::string address_;
  std::string token_;
  std::unique_ptr<link::Link> link_;
  Reading reading_;
  Clock::time_point until_ = Clock::time_point::min();
};

}  // namespace drivebench::web
