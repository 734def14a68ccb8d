#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

/// Every target defines it; replay_corpus.cpp (or libFuzzer) calls it with any bytes. It returns when the
/// code under test kept its promises.
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
