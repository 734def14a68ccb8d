#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "tests/benchmark/harness/disturbance.hpp"
#include "tests/benchmark/harness/plan.hpp"

namespace drivebench::speed {

/// Measures what others take from a CPU: the host, other programs, interrupts, a neighbour on the same core.
/// Look before and after the measurement, on its CPUs and with its scheduling.
///
/// Time: it reads the clock without a pause; between two distant readings another program had the CPU. Speed:
/// eight chains of products and sums side by side fill the arithmetic units, so that a neighbour shows that
/// takes no time; one chain, which waits for itself, was 8 % slower where eight were 40 %. Their median is
/// compared with the best one of this process.
class Canary {
 public:
  Canary();

  void look(std::span<const int> cpus, std::chrono::milliseconds duration = std::chrono::milliseconds(20));

  /// Of all looks.
  Disturbance seen() const noexcept;

 private:
  void look(int cpu, std::chrono::milliseconds duration);

  std::int64_t watched_ns_ = 0;
  std::int64_t gone_ns_ = 0;
  std::vector<double> chains_ns_;  ///< a median for each look at a CPU
};

/// The result of a measurement in its undisturbed rounds; in all of them, if there was none.
template <class Result>
struct Rounds {
  std::vector<Result> results;
  Disturbance disturbance;  ///< mean around these rounds
};

/// Runs rounds until `wanted` were undisturbed, at most twice as many; in a brief run one.
template <class Round>
auto undisturbed_rounds(std::span<const int> cpus, std::size_t wanted, Round round) {
  struct Seen {
    decltype(round()) result;
    Disturbance disturbance;
  };
  std::vector<Seen> quiet;
  std::vector<Seen> disturbed;
  const std::size_t most = planned<std::size_t>(2 * wanted, 1);
  for (std::size_t n = 0; n < most && quiet.size() < wanted; ++n) {
    Canary canary;
    canary.look(cpus);
    auto result = round();
    canary.look(cpus);
    (canary.seen().spoils() ? disturbed : quiet).push_back({std::move(result), canary.seen()});
  }
  Rounds<decltype(round())> kept;
  const std::vector<Seen>& from = quiet.empty() ? disturbed : quiet;
  for (const Seen& seen : from) {
    kept.results.push_back(seen.result);
    kept.disturbance.gone += seen.disturbance.gone / static_cast<double>(from.size());
    kept.disturbance.slowed += seen.disturbance.slowed / static_cast<double>(from.size());
  }
  return kept;
}

}  // namespace drivebench::speed
