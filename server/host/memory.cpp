#include "server/host/memory.hpp"

#include <pthread.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <new>
#include <string_view>

namespace drivebench {
namespace {

constexpr std::size_t kStackBytes = std::size_t{1} << 20;

std::atomic<int> exit_code_without_memory{0};

[[noreturn]] void say_and_end() noexcept {
  constexpr std::string_view kWhy = "drivebench-server: no memory\n";
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kWhy.data(), kWhy.size());
  ::_exit(exit_code_without_memory.load());
}

}  // namespace

void end_without_memory(int exit_code) noexcept {
  exit_code_without_memory.store(exit_code);
  std::set_new_handler(say_and_end);
}

void use_small_stacks() noexcept {
  pthread_attr_t attributes;
  if (pthread_attr_init(&attributes) != 0) return;
  pthread_attr_setstacksize(&attributes, kStackBytes);
  pthread_setattr_default_np(&attributes);  // the default is far larger
  pthread_attr_destroy(&attributes);
}

}  // namespace drivebench
