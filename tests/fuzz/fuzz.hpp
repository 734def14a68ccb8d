#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

/// What every target defines and replay_corpus.cpp (or libFuzzer) calls with bytes of anybody's making. It
/// returns when the code under test did as promised, however bad the bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace drivebench::fuzz {

inline std::span<const std::byte> as_bytes_of(const std::uint8_t* data, std::size_t size) noexcept {
  return std::as_bytes(std::span(data, size));
}

/// A promise that holds for all bytes.
inline void require(bool holds, const char* promise) noexcept {
  if (holds) return;
  std::fprintf(stderr, "fuzz: broken: %s\n", promise);
  std::abort();
}

}  // namespace drivebench::fuzz
