#pragma once

#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

/// Counts what the whole program allocates with new. For one source of a program.
namespace drivebench::fuzz {

struct CountedMemory {
  std::atomic<std::size_t> live{0};  ///< bytes
  std::atomic<std::size_t> peak{0};
  std::atomic<std::size_t> calls{0};
};

inline CountedMemory& counted_memory() noexcept {
  static CountedMemory count;
  return count;
}

/// The memory that an action takes on top of the memory before it.
struct Taken {
  std::size_t peak_bytes;
  std::size_t calls;
};

template <class Action>
Taken taken_by(Action action) {
  CountedMemory& memory = counted_memory();
  const std::size_t before = memory.live;
  const std::size_t calls = memory.calls;
  memory.peak = before;
  action();
  return {.peak_bytes = memory.peak - before, .calls = memory.calls - calls};
}

}  // namespace drivebench::fuzz

// NOLINTBEGIN(misc-definitions-in-headers)
void* operator new(std::size_t size) {
  void* const memory = std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  auto& count = drivebench::fuzz::counted_memory();
  const std::size_t live = count.live += ::malloc_usable_size(memory);
  count.peak = std::max<std::size_t>(count.peak, live);
  ++count.calls;
  return memory;
}
/// The library's would call the one above; a sanitizer's does not.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  try {
    return operator new(size);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
void operator delete(void* memory) noexcept {
  if (memory == nullptr) return;
  drivebench::fuzz::counted_memory().live -= ::malloc_usable_size(memory);
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  operator delete(memory);
}
// NOLINTEND(misc-definitions-in-headers)
