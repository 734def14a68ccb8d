#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <xmmintrin.h>
#else
#include <cfenv>
#endif

namespace drivebench {

/// Rounding to nearest, denormals as they are, no traps: with anything else the same run gives other bits.
/// Libraries that were built with -Ofast change it for the whole process when they are loaded.
#if defined(__SSE2__)
inline constexpr std::uint32_t kDeclaredArithmetic = 0x1F80;  // MXCSR without the flags of what has happened
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

/// Sets the arithmetic of this thread as declared; whether it was another one.
inline bool force_arithmetic() noexcept {
  if (arithmetic() == kDeclaredArithmetic) return false;
  set_arithmetic(kDeclaredArithmetic);
  return true;
}

}  // namespace drivebench
