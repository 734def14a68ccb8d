#include "tests/benchmark/suite/suite_run.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

#include "clients/command/common/programs/installation.hpp"
#include "tests/benchmark/harness/machine.hpp"

namespace drivebench::speed {

SuiteCost run_suite(const std::vector<std::string>& arguments, int code) {
  std::vector<std::string> words{(command::server_executable().parent_path() / "drivebench").string(),
                                 "test"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words)
    argv.push_back(word.data());
  argv.push_back(nullptr);
  const std::int64_t begin = now_ns();
  const pid_t pid = ::fork();
  check(pid >= 0, "fork");
  if (pid == 0) {
    ::dup2(::open("/dev/null", O_WRONLY | O_CLOEXEC), STDOUT_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  int status = 0;
  rusage usage{};
  check(::wait4(pid, &status, 0, &usage) == pid, "wait4");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != code)
    throw std::runtime_error(fmt::format("drivebench test {} did not end with {}", words[2], code));
  return {.wall_s = static_cast<double>(now_ns() - begin) * 1e-9,
          .resident_mib = static_cast<double>(usage.ru_maxrss) / 1024.0};
}

}  // namespace drivebench::speed
