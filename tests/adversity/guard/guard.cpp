// Preloaded: counts the calls of a thread that could wait, allocate or enter the kernel, from guard_begin()
// to guard_end(); and ends the program if an engine makes one in a tick.
#include <dlfcn.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <initializer_list>

#include "tests/adversity/guard/system_allocators.hpp"

namespace {

// initial-exec: reading them allocates nothing, as the library is there from the start.
__attribute__((tls_model("initial-exec"))) thread_local bool inside = false;
__attribute__((tls_model("initial-exec"))) thread_local std::uint64_t hits = 0;
__attribute__((tls_model("initial-exec"))) thread_local const char* first_hit = nullptr;
__attribute__((tls_model("initial-exec"))) thread_local bool in_tick = false;  // of an engine
__attribute__((tls_model("initial-exec"))) thread_local bool was_inside = false;

[[noreturn]] void end_program(const char* what) noexcept {
  for (const char* const piece : {"tick guard: ", what, " in a tick\n"})
    syscall(SYS_write, STDERR_FILENO, piece, std::strlen(piece));
  std::abort();
}

void hit(const char* what) noexcept {
  if (!inside) return;
  if (in_tick) {
    in_tick = inside = false;
    end_program(what);
  }
  if (hits++ == 0) first_hit = what;
}

template <class Function>
Function* next(Function*& known, const char* name) noexcept {
  if (known == nullptr) known = reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
  return known;
}

}  // namespace

EXPORT void guard_begin() {
  hits = 0;
  first_hit = nullptr;
  inside = true;
}
EXPORT void guard_end() {
  inside = false;
}
EXPORT std::uint64_t guard_hits() {
  return hits;
}
EXPORT const char* guard_first_hit() {
  return first_hit == nullptr ? "nothing" : first_hit;
}

// For the engines: tick_mark.hpp. With DRIVEBENCH_MISDEED every tick allocates, which it must not.
EXPORT void drivebench_tick_begins() noexcept {
  was_inside = inside;
  inside = in_tick = true;
  static const bool misdeed = std::getenv("DRIVEBENCH_MISDEED") != nullptr;
  if (misdeed) free(malloc(1));
}
EXPORT void drivebench_tick_ends() noexcept {
  in_tick = false;
  inside = was_inside;
}

EXPORT void* malloc(std::size_t size) noexcept {
  hit("malloc");
  return __libc_malloc(size);
}
EXPORT void* calloc(std::size_t count, std::size_t size) noexcept {
  hit("calloc");
  return __libc_calloc(count, size);
}
EXPORT void* realloc(void* old, std::size_t size) noexcept {
  hit("realloc");
  return __libc_realloc(old, size);
}
EXPORT void free(void* old) noexcept {
  hit("free");
  __libc_free(old);
}
EXPORT void* memalign(std::size_t alignment, std::size_t size) noexcept {
  hit("memalign");
  return __libc_memalign(alignment, size);
}
EXPORT void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  hit("aligned_alloc");
  return __libc_memalign(alignment, size);
}
EXPORT int posix_memalign(void** out, std::size_t alignment, std::size_t size) noexcept {
  hit("posix_memalign");
  void* const got = __libc_memalign(alignment, size);
  if (got == nullptr) return ENOMEM;
  *out = got;
  return 0;
}

// A function that is counted and passed on.
#define COUNT(result, name, parameters, arguments) \
  EXPORT result name parameters {                  \
    static result(*known) parameters = nullptr;    \
    hit(#name);                                    \
    return next(known, #name) arguments;           \
  }

COUNT(int, pthread_mutex_lock, (pthread_mutex_t * m) noexcept, (m))
COUNT(int, pthread_mutex_trylock, (pthread_mutex_t * m) noexcept, (m))
COUNT(int, pthread_mutex_unlock, (pthread_mutex_t * m) noexcept, (m))
COUNT(int, pthread_rwlock_rdlock, (pthread_rwlock_t * l) noexcept, (l))
COUNT(int, pthread_rwlock_wrlock, (pthread_rwlock_t * l) noexcept, (l))
COUNT(int, pthread_spin_lock, (pthread_spinlock_t * l) noexcept, (l))
COUNT(int, pthread_cond_wait, (pthread_cond_t * c, pthread_mutex_t* m), (c, m))
COUNT(int, pthread_cond_timedwait, (pthread_cond_t * c, pthread_mutex_t* m, const timespec* t), (c, m, t))
COUNT(int, pthread_cond_signal, (pthread_cond_t * c) noexcept, (c))
COUNT(int, pthread_cond_broadcast, (pthread_cond_t * c) noexcept, (c))
COUNT(ssize_t, read, (int fd, void* data, std::size_t size), (fd, data, size))
COUNT(ssize_t, write, (int fd, const void* data, std::size_t size), (fd, data, size))
COUNT(int, fsync, (int fd), (fd))
COUNT(int, fdatasync, (int fd), (fd))
COUNT(int, close, (int fd), (fd))
COUNT(int, nanosleep, (const timespec* t, timespec* left), (t, left))
COUNT(int, clock_nanosleep, (clockid_t c, int flags, const timespec* t, timespec* left), (c, flags, t, left))
COUNT(int, clock_gettime, (clockid_t c, timespec* t) noexcept, (c, t))
COUNT(int, sched_yield, () noexcept, ())
