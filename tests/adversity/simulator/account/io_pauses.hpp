#pragma once

#include <vector>

#include "tests/adversity/simulator/world/schedule.hpp"

namespace drivebench::simulator {

/// The times at which the server's I/O stood still, and their effect on the limits that it sets its peers.
class IoPauses {
 public:
  /// The I/O runs now.
  void ran(Time now);
  Time last_run() const noexcept { return last_run_; }
  /// The end of a limit that began at this time, or when the I/O ran next. A limit counts the time in which
  /// the server runs: where it ends in a pause, the peer gets from the end of the pause on as much time as
  /// the pause has lasted beyond it.
  Time end_of(Time begin, Time limit) const;

 private:
  struct Pause {
    Time begin;
    Time end;
  };

  std::vector<Pause> pauses_;  // in order
  Time last_run_ = 0;
};

}  // namespace drivebench::simulator
