#pragma once

// Sanitizers slow code down tenfold, and find a mistake in memory in a tenth of the repetitions, too.
namespace drivebench {

#ifdef DRIVEBENCH_SANITIZED
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

/// So many in an ordinary build, a tenth of them under a sanitizer.
template <class Number>
constexpr Number repetitions(Number of_an_ordinary_build) noexcept {
  return kSanitized ? of_an_ordinary_build / 10 : of_an_ordinary_build;
}

/// Why a test that counts how often something holds is skipped under a sanitizer.
inline constexpr auto kStatistic =
    "a statistic: a tenth of the draws do not judge it, and an ordinary build draws them all";

}  // namespace drivebench
