// Preloaded into a program: memory that runs out, a disk that loses data, threads that stand still,
// arithmetic that a library changed, and a count of the bytes of its recordings. The page in the file that
// MISFORTUNE names is shared with the test that started the program.
#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>
#include <xmmintrin.h>

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>

#include "tests/adversity/guard/system_allocators.hpp"

namespace {

/// The test maps the same page.
struct Page {
  std::atomic<std::uint64_t> handed;       // bytes of recordings handed to write()
  std::atomic<std::uint64_t> taken;        // bytes that it took
  std::atomic<std::int64_t> fail_in;       // allocations of the main thread until one fails; 0: none
  std::atomic<std::uint64_t> allocations;  // of the main thread, since main()
  std::atomic<std::uint64_t> sleep_ms;     // for which SIGUSR2 stops its thread
  std::atomic<std::uint32_t> mxcsr;        // set by SIGUSR1 in its thread
  std::atomic<std::uint32_t> mxcsr_at_start;
  std::atomic<std::uint64_t> syncs_fail;  // 1: every fdatasync()
};

Page none{};
Page* page = &none;
std::atomic<bool> in_main{false};
constexpr int kDescriptors = 256;
std::atomic<bool> is_recording[kDescriptors];

bool is_main_thread() noexcept {
  return syscall(SYS_gettid) == getpid();
}

bool fails() noexcept {
  if (!in_main.load(std::memory_order_relaxed) || page == &none || !is_main_thread()) return false;
  page->allocations.fetch_add(1, std::memory_order_relaxed);
  if (page->fail_in.load(std::memory_order_relaxed) <= 0) return false;
  return page->fail_in.fetch_sub(1, std::memory_order_relaxed) == 1;
}

void stand_still(int) {
  const int error = errno;
  const std::uint64_t ms = page->sleep_ms.load();
  timespec left{static_cast<time_t>(ms / 1000), static_cast<long>(ms % 1000) * 1'000'000};
  while (nanosleep(&left, &left) != 0) {
  }
  errno = error;
}

void change_arithmetic(int, siginfo_t*, void* context) {
  static_cast<ucontext_t*>(context)->uc_mcontext.fpregs->mxcsr = page->mxcsr.load();
}

__attribute__((constructor)) void begin() {
  const char* const name = std::getenv("MISFORTUNE");
  if (name == nullptr) return;
  const int descriptor = open(name, O_RDWR | O_CLOEXEC);
  void* const shared = mmap(nullptr, sizeof(Page), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (shared == MAP_FAILED) std::abort();
  page = static_cast<Page*>(shared);
  struct sigaction still {};
  still.sa_handler = stand_still;
  still.sa_flags = SA_RESTART;
  sigaction(SIGUSR2, &still, nullptr);
  struct sigaction change {};
  change.sa_sigaction = change_arithmetic;
  change.sa_flags = SA_SIGINFO | SA_RESTART;
  sigaction(SIGUSR1, &change, nullptr);
  if (page->mxcsr_at_start.load() != 0) _mm_setcsr(page->mxcsr_at_start.load());
}

int (*real_main)(int, char**, char**) = nullptr;
int counted_main(int argc, char** argv, char** environment) {
  in_main.store(true);
  return real_main(argc, argv, environment);
}

}  // namespace

// NOLINTNEXTLINE: the name is glibc's
EXPORT int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(),
                             void (*fini)(), void (*linker_fini)(), void* stack_end) {
  using Start = int (*)(int (*)(int, char**, char**), int, char**, void (*)(), void (*)(), void (*)(), void*);
  real_main = main;
  const auto start = reinterpret_cast<Start>(dlsym(RTLD_NEXT, "__libc_start_main"));
  return start(counted_main, argc, argv, init, fini, linker_fini, stack_end);
}

EXPORT void* malloc(std::size_t size) noexcept {
  if (fails()) return errno = ENOMEM, nullptr;
  return __libc_malloc(size);
}
EXPORT void* calloc(std::size_t count, std::size_t size) noexcept {
  if (fails()) return errno = ENOMEM, nullptr;
  return __libc_calloc(count, size);
}
EXPORT void* realloc(void* old, std::size_t size) noexcept {
  if (fails()) return errno = ENOMEM, nullptr;
  return __libc_realloc(old, size);
}
EXPORT void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  if (fails()) return errno = ENOMEM, nullptr;
  return __libc_memalign(alignment, size);
}

EXPORT int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  const int descriptor = static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, mode));
  if (descriptor >= 0 && descriptor < kDescriptors) {
    const std::size_t length = std::strlen(path);
    is_recording[descriptor].store((flags & O_CREAT) != 0 && length > 5 &&
                                   std::strcmp(path + length - 5, ".mcap") == 0);
  }
  return descriptor;
}

EXPORT ssize_t write(int descriptor, const void* data, std::size_t size) {
  const bool counts = descriptor >= 0 && descriptor < kDescriptors && is_recording[descriptor].load();
  if (counts) page->handed.fetch_add(size);
  const ssize_t written = syscall(SYS_write, descriptor, data, size);
  if (counts && written > 0) page->taken.fetch_add(static_cast<std::uint64_t>(written));
  return written;
}

EXPORT int fdatasync(int descriptor) {
  if (page->syncs_fail.load() != 0) return errno = EIO, -1;
  return static_cast<int>(syscall(SYS_fdatasync, descriptor));
}
