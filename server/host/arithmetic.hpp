#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <xmmintrin.h>
#else
#include <cfenv>
#endif

namespace drivebench {

/// Rounding to nearest, denormals kept, no traps: any other setting changes the bits of a run. Loading a
/// library built with -Ofast changes it for the whole process.
#if defined(__SSE2__)
inline constexpr std::uint32_t kDeclaredArithmetic = 0x1F80;  // MXCSR without the exception flags
inline constexpr std::uint32_t kArithmeticFlags = 0x3F;
inline std::uint32_t arithmetic() noexcept {
  return _mm_getcsr() & ~kArithmeticFlags;
}
inline void set_arithmetic(std::uint32_t word) noexcept {
  _mm_setcsr(word);
}
#else
inline constexpr std::uint32_t kDeclaredArithmetic = FE_TONEAREST;
inline std::uint32_t arithmetic() noexcept {
  return static_cast<std::uint32_t>(std::fegetround());
}
inline void set_arithmetic(std::uint32_t word) noexcept {
  std::fesetround(static_cast<int>(word));
}
#endif

/// Sets the declared arithmetic in this thread; returns whether it was different.
inline bool force_arithmetic() noexcept {
  if (arithmetic() == kDeclaredArithmetic) return false;
  set_arithmetic(kDeclaredArithmetic);
  return true;
}

}  // namespace drivebench
