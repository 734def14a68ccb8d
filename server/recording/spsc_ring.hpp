#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>

namespace drivebench {

/// Whether a queue touches its memory before it is used, so that no push has to wait for a page.
enum class Pages { kTouched, kUntouched };

/// A bounded queue between one producer thread and one consumer thread, wait-free on both sides. The
/// constructor allocates all memory.
template <class T>
class SpscRing {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit SpscRing(std::size_t capacity, Pages pages = Pages::kTouched)
      : capacity_(capacity), slots_(std::allocator<T>().allocate(capacity)) {
    if (pages == Pages::kTouched) std::uninitialized_value_construct_n(slots_, capacity);
  }
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;
  ~SpscRing() { std::allocator<T>().deallocate(slots_, capacity_); }

  /// Producer: false if the ring is full.
  bool push(const T& value) noexcept { return emplace(value); }

  /// Producer: constructs the entry in place; false if the ring is full.
  template <class... Arguments>
  bool emplace(Arguments&&... arguments) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_seen_ >= capacity_) {
      head_seen_ = head_.load(std::memory_order_acquire);
      if (tail - head_seen_ >= capacity_) return false;
    }
    std::construct_at(&slots_[tail_slot_], std::forward<Arguments>(arguments)...);
    tail_slot_ = after(tail_slot_);
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  /// Producer: the number of entries that fit now.
  std::size_t room() noexcept {
    head_seen_ = head_.load(std::memory_order_acquire);
    return capacity_ - (tail_.load(std::memory_order_relaxed) - head_seen_);
  }

  /// Consumer: the oldest entry, or null. It stays valid until pop().
  const T* front() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_seen_) {
      tail_seen_ = tail_.load(std::memory_order_acquire);
      if (head == tail_seen_) return nullptr;
    }
    return &slots_[head_slot_];
  }
  void pop() noexcept {
    head_slot_ = after(head_slot_);
    head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  std::size_t capacity() const noexcept { return capacity_; }

 private:
  std::size_t after(std::size_t slot) const noexcept { return slot + 1 == capacity_ ? 0 : slot + 1; }

  static constexpr std::size_t kCacheLine = 64;

  std::size_t capacity_;
  T* slots_;
  alignas(kCacheLine) std::atomic<std::size_t> head_{0};
  std::size_t head_slot_ = 0;  // of the consumer, as the next one
  std::size_t tail_seen_ = 0;
  alignas(kCacheLine) std::atomic<std::size_t> tail_{0};
  std::size_t tail_slot_ = 0;  // of the producer, as the next one
  std::size_t head_seen_ = 0;
};

}  // namespace drivebench
