#include "server/pacing/pacer.hpp"

#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

namespace drivebench {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;

// sleep+spin wakes this much before the deadline: about the p99 of the wake-up latency of an idle core.
constexpr std::int64_t kSpinNs = 30'000;

std::int64_t now_ns(clockid_t clock = CLOCK_MONOTONIC) noexcept {
  timespec t{};
  clock_gettime(clock, &t);
  return t.tv_sec * kSecondNs + t.tv_nsec;
}

void sleep_until(std::int64_t time_ns) noexcept {
  const timespec t{.tv_sec = time_ns / kSecondNs, .tv_nsec = time_ns % kSecondNs};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
}

/// CLOCK_REALTIME less CLOCK_MONOTONIC: the best of a few readings, since this thread may lose its CPU
/// between two.
std::int64_t unix_ahead_ns() noexcept {
  std::int64_t ahead = 0;
  std::int64_t shortest = kSecondNs;
  for (int reading = 0; reading < 4; ++reading) {
    const std::int64_t before = now_ns();
    const std::int64_t wall = now_ns(CLOCK_REALTIME);
    const std::int64_t took = now_ns() - before;
    if (reading > 0 && took >= shortest) continue;
    shortest = took;
    ahead = wall - (before + took / 2);
  }
  return ahead;
}

class RealtimePacer final : public Pacer {
 public:
  RealtimePacer(std::int64_t period_ns, std::int64_t spin_ns) noexcept
      : period_ns_(period_ns), spin_ns_(spin_ns) {}

  std::int64_t wait() noexcept override {
    if (due_ns_ == 0) {
      resynchronise();
      due_ns_ -= period_ns_;
    }
    due_ns_ += period_ns_;
    std::int64_t now = now_ns();
    if (now < due_ns_ - spin_ns_) {
      sleep_until(due_ns_ - spin_ns_);
      now = now_ns();
    }
    while (now < due_ns_)
      now = now_ns();
    return now - due_ns_;
  }

  void resynchronise() noexcept override {
    due_ns_ = now_ns();
    unix_ahead_ns_ = unix_ahead_ns();
  }
  std::int64_t due_ns() const noexcept override { return due_ns_; }
  std::int64_t due_unix_ns() const noexcept override { return due_ns_ + unix_ahead_ns_; }

 private:
  std::int64_t period_ns_;
  std::int64_t spin_ns_;
  std::int64_t due_ns_ = 0;
  std::int64_t unix_ahead_ns_ = 0;  ///< of CLOCK_MONOTONIC, when time zero was set
};

class FreePacer final : public Pacer {
 public:
  std::int64_t wait() noexcept override { return 0; }
  void resynchronise() noexcept override {}
};

}  // namespace

std::unique_ptr<Pacer> make_realtime_pacer(PacerKind kind, std::int64_t period_ns) {
  const std::int64_t spin_ns = kind == PacerKind::kSleepSpin ? std::min(kSpinNs, period_ns / 2) : 0;
  return std::make_unique<RealtimePacer>(period_ns, spin_ns);
}

std::unique_ptr<Pacer> make_free_pacer() {
  return std::make_unique<FreePacer>();
}

std::vector<std::string> enter_realtime(const RealtimeConfig& config) {
  std::vector<std::string> notes;
  if (config.priority > 0) {
    const sched_param parameters{.sched_priority = config.priority};
    if (const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters); error != 0) {
      notes.push_back(fmt::format("no real-time scheduling (SCHED_FIFO {}): {}; expect late ticks under load",
                                  config.priority, std::strerror(error)));
    }
  }
  if (config.cpu >= 0) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(config.cpu), &set);
    if (const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set); error != 0) {
      notes.push_back(fmt::format("not pinned to CPU {}: {}", config.cpu, std::strerror(error)));
    }
  }
  // With MCL_FUTURE every later allocation beyond a small limit would fail.
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  const bool unlimited = limit.rlim_cur == RLIM_INFINITY || geteuid() == 0;
  if (!unlimited || mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    notes.push_back(unlimited
                        ? fmt::format("memory not locked: {}", std::strerror(errno))
                        : fmt::format("memory not locked: RLIMIT_MEMLOCK is {} KiB", limit.rlim_cur / 1024));
  }
  return notes;
}

}  // namespace drivebench
