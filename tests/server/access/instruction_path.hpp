#pragma once

#include <sys/ptrace.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <optional>

namespace drivebench::test {

/// The instructions that a program executes, in order.
struct InstructionPath {
  std::uint64_t count = 0;
  std::uint64_t hash = 0;  ///< of their addresses, in order
  friend bool operator==(const InstructionPath&, const InstructionPath&) = default;
};

/// Carries out `call` in a child, one instruction at a time. Children of one process have the same addresses,
/// so equal executions have equal paths. Empty if the kernel or the processor does not offer that.
template <class Call>
std::optional<InstructionPath> instruction_path(Call call) {
#ifdef __x86_64__
  const pid_t child = ::fork();
  if (child == 0) {
    if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) ::_exit(1);
    ::raise(SIGSTOP);
    call();
    ::raise(SIGSTOP);
    ::_exit(0);
  }
  int status = 0;
  InstructionPath path{.hash = 0xcbf29ce484222325};  // FNV-1a
  bool whole = false;
  if (::waitpid(child, &status, 0) == child && WIFSTOPPED(status)) {
    while (::ptrace(PTRACE_SINGLESTEP, child, nullptr, nullptr) == 0 &&
           ::waitpid(child, &status, 0) == child && WIFSTOPPED(status)) {
      whole = WSTOPSIG(status) == SIGSTOP;
      if (WSTOPSIG(status) != SIGTRAP) break;
      user_regs_struct registers{};
      ::ptrace(PTRACE_GETREGS, child, nullptr, &registers);
      path.hash = (path.hash ^ registers.rip) * 0x100000001b3;
      ++path.count;
    }
    ::kill(child, SIGKILL);
    ::waitpid(child, &status, 0);
  }
  if (whole) return path;
#else
  static_cast<void>(call);
#endif
  return std::nullopt;
}

}  // namespace drivebench::test
