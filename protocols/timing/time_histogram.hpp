#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace drivebench {

/// Counts durations [ns] in bins whose width is 1 ns below 128 ns, and from there on at most 1/64 of the
/// duration, so that all that it tells is right to 0.8 %; smallest and worst are exact. Its memory does not
/// grow.
class TimeHistogram {
 public:
  /// Longer durations, from 18 minutes on, count in the last bin.
  static constexpr int kMostBits = 40;

  void add(std::int64_t duration_ns, std::uint64_t times = 1) noexcept;
  void add(const TimeHistogram& other) noexcept;

  std::uint64_t count() const noexcept { return count_; }
  /// 0 if it is empty, as all that follows.
  std::int64_t smallest_ns() const noexcept { return count_ == 0 ? 0 : smallest_ns_; }
  std::int64_t worst_ns() const noexcept { return worst_ns_; }
  /// The duration that this share (0..1) of all entries does not exceed.
  double percentile_ns(double share) const noexcept;
  /// The root of the mean square of the deviations from the median.
  double jitter_rms_ns() const noexcept;
  /// The largest deviation from the median.
  double jitter_peak_ns() const noexcept;

  /// Calls see(lower edge [ns], upper edge [ns], count) for each bin that is not empty, in their order.
  template <class See>
  void each_bin(See see) const {
    for (std::size_t bin = 0; bin < bins_.size(); ++bin)
      if (bins_[bin] != 0) see(lower_edge_ns(bin), lower_edge_ns(bin + 1), bins_[bin]);
  }

 private:
  static constexpr std::size_t kBinsOfOctave = 64;
  static constexpr std::size_t kBins = kBinsOfOctave * (kMostBits - 5);

  static constexpr std::size_t bin_of(std::uint64_t duration_ns) noexcept {
    if (duration_ns < 2 * kBinsOfOctave) return duration_ns;
    const int shift = static_cast<int>(std::bit_width(duration_ns)) - 7;
    return static_cast<std::size_t>(shift) * kBinsOfOctave + (duration_ns >> shift);
  }
  static constexpr std::int64_t lower_edge_ns(std::size_t bin) noexcept {
    if (bin < 2 * kBinsOfOctave) return static_cast<std::int64_t>(bin);
    const std::size_t shift = bin / kBinsOfOctave - 1;
    return static_cast<std::int64_t>((bin - shift * kBinsOfOctave) << shift);
  }

  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  std::int64_t smallest_ns_ = 0;
  std::int64_t worst_ns_ = 0;
};

}  // namespace drivebench
