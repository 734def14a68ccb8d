#include "clients/command/common/programs/process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <system_error>
#include <thread>

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

std::vector<char*> c_arguments(std::vector<std::string>& arguments) {
  std::vector<char*> pointers;
  pointers.reserve(arguments.size() + 1);
  for (std::string& argument : arguments)
    pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  return pointers;
}

int milliseconds_until(Process::Deadline deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
  return static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 1'000'000));
}

/// The environment of this process with some variables in the place of its own.
std::vector<std::string> environment_with(const std::vector<std::string>& variables) {
  std::vector<std::string> all = variables;
  for (char** each = environ; *each != nullptr; ++each) {
    const std::string_view variable = *each;
    const std::string_view name = variable.substr(0, variable.find('=') + 1);
    const auto is_same = [name](const std::string& other) { return other.starts_with(name); };
    if (std::ranges::none_of(variables, is_same)) all.emplace_back(variable);
  }
  return all;
}

/// In the child, before it becomes the other program.
bool prepare_child(const ProcessSettings& settings, int output) noexcept {
  if (settings.own_group) ::setpgid(0, 0);
  if (!settings.folder.empty() && ::chdir(settings.folder.c_str()) != 0) return false;
  int error = STDERR_FILENO;
  if (!settings.error_file.empty()) {
    error = ::open(settings.error_file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (error < 0 || ::dup2(error, STDERR_FILENO) < 0) return false;
  }
  if (!settings.input_file.empty()) {
    const int input = ::open(settings.input_file.c_str(), O_RDONLY | O_CLOEXEC);
    if (input < 0 || ::dup2(input, STDIN_FILENO) < 0) return false;
  }
  return ::dup2(settings.joins_output ? error : output, STDOUT_FILENO) >= 0;
}

[[noreturn]] void system_failure(const std::string& what) {
  throw std::system_error(errno, std::generic_category(), what);
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments, const ProcessSettings& settings)
    : own_group_(settings.own_group) {
  // Between fork and exec there must be no allocation: another thread may have held the lock.
  std::vector<std::string> copy = arguments;
  const std::vector<char*> pointers = c_arguments(copy);
  std::vector<std::string> variables = environment_with(settings.environment);
  const std::vector<char*> environment = c_arguments(variables);
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) system_failure("pipe");
  output_ = link::FileDescriptor(ends[0]);
  link::FileDescriptor child_end(ends[1]);
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ < 0) system_failure("fork");
  if (pid_ == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() == parent && prepare_child(settings, child_end.get())) {
      ::execvpe(pointers[0], pointers.data(), environment.data());
    }
    ::_exit(127);
  }
}

Process::~Process() {
  if (exit_code_) return;
  signal(SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void Process::signal(int number) noexcept {
  // Its group exists only once the child has made it.
  if (!own_group_ || ::kill(-pid_, number) != 0) ::kill(pid_, number);
}

std::optional<std::string> Process::read_line(Deadline deadline) {
  for (;;) {
    if (const std::size_t end = buffer_.find('\n'); end != std::string::npos) {
      std::string line = buffer_.substr(0, end);
      buffer_.erase(0, end + 1);
      return line;
    }
    pollfd waiting = {.fd = output_.get(), .events = POLLIN, .revents = 0};
    const int ready = ::poll(&waiting, 1, milliseconds_until(deadline));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return std::nullopt;
    std::array<char, 4096> piece{};
    const ssize_t got = ::read(output_.get(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return std::nullopt;
    buffer_.append(piece.data(), static_cast<std::size_t>(got));
  }
}

void Process::terminate() noexcept {
  if (!exit_code_) signal(SIGTERM);
}

std::optional<int> Process::wait(Deadline deadline) {
  while (!exit_code_) {
    int status = 0;
    const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
    if (ended < 0 && errno != EINTR) system_failure("waitpid");
    if (ended == pid_) {
      exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      if (own_group_) ::kill(-pid_, SIGKILL);  // what it has left behind
    } else if (std::chrono::steady_clock::now() >= deadline) {
      break;
    } else {
      std::this_thread::sleep_for(2ms);
    }
  }
  return exit_code_;
}

void replace_process(const std::vector<std::string>& arguments) {
  std::vector<std::string> copy = arguments;
  const std::vector<char*> pointers = c_arguments(copy);
  ::execv(pointers[0], pointers.data());
  system_failure(arguments.front());
}

}  // namespace drivebench::command
