#include "clients/command/doctor/wake_ups.hpp"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <ctime>
#include <thread>
#include <vector>

namespace drivebench::command {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kStep_ns = 1'000'000;

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * kSecond_ns + now.tv_nsec;
}

void sleep_until(std::int64_t time_ns) {
  const timespec until = {.tv_sec = time_ns / kSecond_ns, .tv_nsec = time_ns % kSecond_ns};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
  }
}

}  // namespace

WakeUps measure_wake_ups(double duration_s, std::int64_t period_ns) {
  WakeUps result;
  result.count = static_cast<std::int64_t>(duration_s * 1e9) / kStep_ns;
  std::vector<std::int64_t> late_ns(static_cast<std::size_t>(result.count));
  std::thread([&] {
    const sched_param priority = {.sched_priority = kTickPriority};
    result.real_time = ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &priority) == 0;
    std::int64_t due_ns = now_ns();
    for (std::int64_t& late : late_ns) {
      due_ns += kStep_ns;
      sleep_until(due_ns);
      late = now_ns() - due_ns;
      due_ns = std::max(due_ns, now_ns() - kStep_ns);  // what was slept through is one late wake-up
    }
  }).join();
  if (late_ns.empty()) return result;
  std::ranges::sort(late_ns);
  result.p50_ns = late_ns[late_ns.size() / 2];
  result.p99_ns = late_ns[late_ns.size() * 99 / 100];
  result.worst_ns = late_ns.back();
  result.late = std::ranges::count_if(late_ns, [&](std::int64_t each) { return each >= period_ns; });
  return result;
}

std::int64_t clock_resolution_ns() {
  timespec resolution{};
  ::clock_getres(CLOCK_MONOTONIC, &resolution);
  return resolution.tv_sec * kSecond_ns + resolution.tv_nsec;
}

}  // namespace drivebench::command
