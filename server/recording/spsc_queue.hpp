#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numeric>
#include <type_traits>
#include <utility>
#include <vector>

namespace drivebench {

/// Whether a queue touches its memory before it is used, so that no push has to wait for a page.
enum class Pages { kTouched, kUntouched };

/// A bounded queue between one producer thread and one consumer thread, wait-free on both sides: a push walks
/// through the blocks that were emptied since the last one began, a microsecond for 30,000 entries. The
/// constructor allocates all memory.
///
/// The entries lie in blocks. The block that the consumer has emptied last is the next one to be filled: it
/// is still in the caches of the processor, and a queue that is rarely long uses few blocks however many it
/// has. A ring goes through all of its memory instead.
template <class T>
class SpscQueue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  static constexpr std::size_t kBlockEntries = 64;

  explicit SpscQueue(std::size_t capacity, Pages pages = Pages::kTouched)
      : capacity_(capacity),
        next_((capacity + kBlockEntries - 1) / kBlockEntries + 1),
        order_(next_.size()),
        entries_(std::allocator<T>().allocate(next_.size() * kBlockEntries)) {
    if (pages == Pages::kTouched) {
      std::uninitialized_value_construct_n(entries_, next_.size() * kBlockEntries);
    }
    std::iota(next_.begin(), next_.end(), 1u);
    next_.back() = kNone;
  }
  SpscQueue(const SpscQueue&) = delete;
  SpscQueue& operator=(const SpscQueue&) = delete;
  ~SpscQueue() { std::allocator<T>().deallocate(entries_, next_.size() * kBlockEntries); }

  /// Producer: false if the queue is full.
  bool push(const T& value) noexcept { return emplace(value); }

  /// Producer: constructs the entry in place; false if the queue is full.
  template <class... Arguments>
  bool emplace(Arguments&&... arguments) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_seen_ >= capacity_) {
      head_seen_ = head_.load(std::memory_order_acquire);
      if (tail - head_seen_ >= capacity_) return false;
    }
    if (filled_ == kBlockEntries) begin_block();
    std::construct_at(filling_ + filled_++, std::forward<Arguments>(arguments)...);
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
    return block(order_[oldest_]) + taken_;
  }
  void pop() noexcept {
    if (++taken_ == kBlockEntries) end_block();
    head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  std::size_t capacity() const noexcept { return capacity_; }

 private:
  using Index = std::uint32_t;
  static constexpr Index kNone = ~Index{0};

  T* block(Index index) noexcept { return entries_ + index * kBlockEntries; }
  std::size_t after(std::size_t place) const noexcept { return place + 1 == order_.size() ? 0 : place + 1; }

  /// Producer, with room for an entry: then a block is free.
  void begin_block() noexcept {
    if (const Index emptied = emptied_.exchange(kNone, std::memory_order_acquire); emptied != kNone) {
      Index last = emptied;
      while (next_[last] != kNone)
        last = next_[last];
      next_[last] = std::exchange(free_, emptied);
    }
    order_[newest_] = free_;
    newest_ = after(newest_);
    filling_ = block(free_);
    filled_ = 0;
    free_ = next_[free_];
  }

  /// Consumer. The producer takes all emptied blocks at once, so that a second try succeeds.
  void end_block() noexcept {
    const Index emptied = order_[oldest_];
    oldest_ = after(oldest_);
    taken_ = 0;
    next_[emptied] = emptied_.load(std::memory_order_relaxed);
    while (!emptied_.compare_exchange_strong(next_[emptied], emptied, std::memory_order_release,
                                             std::memory_order_relaxed)) {
    }
  }

  static constexpr std::size_t kCacheLine = 64;

  std::size_t capacity_;
  std::vector<Index> next_;   ///< of each block that is free, the next one: a list
  std::vector<Index> order_;  ///< the blocks with entries, as a ring: from oldest_ to the one before newest_
  T* entries_;
  alignas(kCacheLine) std::atomic<std::size_t> head_{0};
  std::atomic<Index> emptied_{kNone};  ///< the last block that the consumer has emptied
  std::size_t oldest_ = 0;             // of the consumer, as the next two
  std::size_t taken_ = 0;              ///< entries of the oldest block
  std::size_t tail_seen_ = 0;
  alignas(kCacheLine) std::atomic<std::size_t> tail_{0};
  T* filling_ = nullptr;                // of the producer, as the next ones
  std::size_t filled_ = kBlockEntries;  ///< entries of the newest block
  std::size_t newest_ = 0;
  Index free_ = 0;  ///< the first of the free blocks that the consumer has given back before
  std::size_t head_seen_ = 0;
};

}  // namespace drivebench
