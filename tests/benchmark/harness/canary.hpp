#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <span>
#include <vector>

namespace drivebench::speed {

/// Beyond this share of gone time a figure says more about the machine than about the program.
inline constexpr double kMaxGone = 0.03;

/// Measures the share of a CPU that others take: the host, other programs, interrupts. It reads the clock
/// without a pause; between two distant readings another program had the CPU. Look before and after the
/// measurement, on its CPUs and with its scheduling.
class GapCanary {
 public:
  void look(std::span<const int> cpus, std::chrono::milliseconds duration = std::chrono::milliseconds(20));

  /// Share of the time (0..1) that was gone in all looks.
  double gone() const noexcept;

 private:
  void look(int cpu, std::chrono::milliseconds duration);

  std::int64_t watched_ns_ = 0;
  std::int64_t gone_ns_ = 0;
};

/// The result of a measurement in its undisturbed rounds; in all of them, if there was none.
template <class Result>
struct Rounds {
  std::vector<Result> results;
  double gone = 0.0;  ///< share of the time that was gone around these rounds
};

/// Runs rounds until `wanted` were undisturbed, at most twice as many.
template <class Round>
auto undisturbed_rounds(std::span<const int> cpus, std::size_t wanted, Round round) {
  struct Seen {
    decltype(round()) result;
    double gone;
  };
  std::vector<Seen> quiet;
  std::vector<Seen> disturbed;
  for (std::size_t n = 0; n < 2 * wanted && quiet.size() < wanted; ++n) {
    GapCanary canary;
    canary.look(cpus);
    auto result = round();
    canary.look(cpus);
    (canary.gone() > kMaxGone ? disturbed : quiet).push_back({std::move(result), canary.gone()});
  }
  Rounds<decltype(round())> kept;
  const std::vector<Seen>& from = quiet.empty() ? disturbed : quiet;
  for (const Seen& seen : from) {
    kept.results.push_back(seen.result);
    kept.gone += seen.gone / static_cast<double>(from.size());
  }
  return kept;
}

}  // namespace drivebench::speed
