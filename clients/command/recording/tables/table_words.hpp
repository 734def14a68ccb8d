#pragma once

#include <bit>
#include <cstdint>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::command {

/// The eight bytes of a signal, whatever its type.
inline std::uint64_t word_of(const Signal& signal, const Sample& sample) noexcept {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return sample.*signal.as_unsigned;
    case SignalType::kSigned:
      return std::bit_cast<std::uint64_t>(sample.*signal.as_signed);
    case SignalType::kReal:
      break;
  }
  return std::bit_cast<std::uint64_t>(sample.*signal.as_real);
}

/// The time of a sample in seconds, from its nanoseconds.
inline double seconds(std::uint64_t time_ns) noexcept {
  return static_cast<double>(time_ns) / 1e9;  // rounded once, as the shortest decimal is
}

}  // namespace drivebench::command
