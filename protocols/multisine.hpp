#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

/// The frequencies of a multisine: the bench makes the signal, and a check on the answer asks for the same
/// ones. Includes nothing but std.
namespace drivebench {

inline constexpr std::uint32_t kMostMultisineLines = 64;
inline constexpr std::uint32_t kShortestMultisinePeriod = 8;                      ///< [ticks]
inline constexpr std::uint32_t kLongestMultisinePeriod = std::uint32_t{1} << 30;  ///< [ticks]
inline constexpr std::uint32_t kMostMultisinePeriods = 1'000'000;
inline constexpr double kDefaultMultisineRatio = 1.25;
inline constexpr double kLeastMultisineRatio = 1.01;
inline constexpr double kMostMultisineRatio = 100.0;

/// Lines at multiples of 1/period, so that each has whole periods in a period of the sum.
struct MultisineLines {
  std::uint32_t period_ticks;
  std::uint32_t lowest;   ///< the multiple of the first line
  std::uint32_t highest;  ///< no line lies above this multiple
  double ratio;           ///< of a line to the one before, rounded to the next multiple
};

/// The multiple of the line above this one: the same on every machine, because it needs no logarithm.
constexpr std::uint64_t next_line(std::uint64_t multiple, double ratio) noexcept {
  return std::max(multiple + 1, static_cast<std::uint64_t>(static_cast<double>(multiple) * ratio + 0.5));
}

/// The multiples of the lines in their order; one more than the most if there are more.
struct LineList {
  std::array<std::uint64_t, kMostMultisineLines + 1> multiple{};
  std::size_t count = 0;
};
constexpr LineList lines_of(const MultisineLines& lines) noexcept {
  LineList list;
  for (std::uint64_t n = lines.lowest; n <= lines.highest && list.count < list.multiple.size();
       n = next_line(n, lines.ratio))
    list.multiple[list.count++] = n;
  return list;
}

/// The phase by which the j-th line lags [turns]. It keeps the peak at 1.5 to 2.5 times the amplitude times
/// the root of the number of lines, where equal phases would add up; Schroeder's rule is for lines that are
/// equally far from each other, and leaves up to 3.3 here.
constexpr double line_phase(std::uint64_t j) noexcept {
  return static_cast<double>(309 * j * j % 1000) / 1000.0;
}

/// Whether a period has samples for every line: at least one line, at most the most, all below half the rate.
constexpr bool are_possible(const MultisineLines& lines) noexcept {
  return lines.period_ticks >= kShortestMultisinePeriod && lines.period_ticks <= kLongestMultisinePeriod &&
         lines.lowest >= 1 && lines.lowest <= lines.highest && lines.highest < (lines.period_ticks + 1) / 2 &&
         lines.ratio >= kLeastMultisineRatio && lines.ratio <= kMostMultisineRatio &&
         lines_of(lines).count <= kMostMultisineLines;
}

/// The multiple of 1/period that is nearest to a frequency; 0 or the largest number beyond what can be one.
inline std::uint32_t nearest_multiple(double frequency_hz, std::uint32_t period_ticks,
                                      double tick_s) noexcept {
  const double multiple = std::round(frequency_hz * static_cast<double>(period_ticks) * tick_s);
  return static_cast<std::uint32_t>(std::clamp(multiple, 0.0, 4e9));
}

}  // namespace drivebench
