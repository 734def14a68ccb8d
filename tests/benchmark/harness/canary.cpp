#include "tests/benchmark/harness/canary.hpp"

#include <algorithm>

#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/statistics.hpp"

namespace drivebench::speed {
namespace {

// Two readings are 20 to 60 ns apart when nothing comes between them; in a guest up to 40 us, where a reading
// may be a slow system call.
constexpr std::int64_t kGapNs = 1000;
constexpr std::int64_t kReadingsPerGap = 10;

/// A longer gap is an interruption.
std::int64_t gap_ns() {
  static const std::int64_t limit = [] {
    std::vector<double> apart(1001);
    for (std::int64_t last = now_ns(); double& each : apart) {
      const std::int64_t now = now_ns();
      each = static_cast<double>(now - last);
      last = now;
    }
    return std::max(kGapNs, kReadingsPerGap * static_cast<std::int64_t>(percentile(std::move(apart), 0.5)));
  }();
  return limit;
}

}  // namespace

void GapCanary::look(std::span<const int> cpus, std::chrono::milliseconds duration) {
  for (const int cpu : cpus)
    look(cpu, duration);
}

void GapCanary::look(int cpu, std::chrono::milliseconds duration) {
  const Pinned pinned(cpu);
  const std::int64_t gap = gap_ns();
  const std::int64_t begin = now_ns();
  const std::int64_t end = begin + std::chrono::nanoseconds(duration).count();
  std::int64_t last = begin;
  while (last < end) {
    const std::int64_t now = now_ns();
    if (now - last > gap) gone_ns_ += now - last;
    last = now;
  }
  watched_ns_ += last - begin;
}

double GapCanary::gone() const noexcept {
  return watched_ns_ == 0 ? 0.0 : static_cast<double>(gone_ns_) / static_cast<double>(watched_ns_);
}

}  // namespace drivebench::speed
