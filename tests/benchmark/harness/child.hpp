#pragma once

#include <sys/prctl.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "tests/benchmark/harness/machine.hpp"

namespace drivebench::speed {

/// A copy of this process that does one thing. It ends with this object, or with this program. Made while
/// this program has one thread.
class Child {
 public:
  /// `work` must not throw.
  template <class Work>
  explicit Child(Work work) : pid_(::fork()) {
    check(pid_ >= 0, "fork");
    if (pid_ > 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    work();
    ::_exit(0);
  }
  ~Child() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

 private:
  pid_t pid_;
};

}  // namespace drivebench::speed
