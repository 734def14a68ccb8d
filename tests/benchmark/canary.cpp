#include "tests/benchmark/canary.hpp"

#include "tests/benchmark/machine.hpp"

namespace drivebench::speed {
namespace {

// Two readings are 20 to 60 ns apart when nothing comes between them.
constexpr std::int64_t kGapNs = 1000;

}  // namespace

void GapCanary::look(std::span<const int> cpus, std::chrono::milliseconds duration) {
  for (const int cpu : cpus)
    look(cpu, duration);
}

void GapCanary::look(int cpu, std::chrono::milliseconds duration) {
  const Pinned pinned(cpu);
  const std::int64_t begin = now_ns();
  const std::int64_t end = begin + std::chrono::nanoseconds(duration).count();
  std::int64_t last = begin;
  while (last < end) {
    const std::int64_t now = now_ns();
    if (now - last > kGapNs) gone_ns_ += now - last;
    last = now;
  }
  watched_ns_ += last - begin;
}

double GapCanary::gone() const noexcept {
  return watched_ns_ == 0 ? 0.0 : static_cast<double>(gone_ns_) / static_cast<double>(watched_ns_);
}

}  // namespace drivebench::speed
