#include "tests/benchmark/harness/canary.hpp"

#include <benchmark/benchmark.h>

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

constexpr int kChainLength = 2000;    // some 10 us
constexpr std::size_t kChains = 100;  // in a look: 1 ms

void link(double& value) {
  value = value * 0.999999 + 1e-6;
}

double median_chain_ns() {
  std::vector<double> each_ns(kChains);
  for (double& ns : each_ns) {
    // Eight names: of an array the compiler would make pairs, which wait for memory.
    double a = 2.0, b = 3.0, c = 4.0, d = 5.0, e = 6.0, f = 7.0, g = 8.0, h = 9.0;
    const std::int64_t begin = now_ns();
    for (int k = 0; k < kChainLength; ++k) {
      link(a), link(b), link(c), link(d), link(e), link(f), link(g), link(h);
    }
    double end = a + b + c + d + e + f + g + h;
    ::benchmark::DoNotOptimize(end);
    ns = static_cast<double>(now_ns() - begin);
  }
  return percentile(std::move(each_ns), 0.5);
}

/// The best that this process has seen, at first over 20 ms.
double& best_chain_ns() {
  static double best = [] {
    double least = median_chain_ns();
    for (int n = 1; n < 20; ++n)
      least = std::min(least, median_chain_ns());
    return least;
  }();
  return best;
}

}  // namespace

Canary::Canary() {
  best_chain_ns();
}

void Canary::look(std::span<const int> cpus, std::chrono::milliseconds duration) {
  for (const int cpu : cpus)
    look(cpu, duration);
}

void Canary::look(int cpu, std::chrono::milliseconds duration) {
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
  chains_ns_.push_back(median_chain_ns());
  best_chain_ns() = std::min(best_chain_ns(), chains_ns_.back());
}

Disturbance Canary::seen() const noexcept {
  if (chains_ns_.empty()) return {};
  const double slowest_ns = *std::max_element(chains_ns_.begin(), chains_ns_.end());
  return {.gone = static_cast<double>(gone_ns_) / static_cast<double>(watched_ns_),
          .slowed = slowest_ns / best_chain_ns() - 1.0};
}

}  // namespace drivebench::speed
