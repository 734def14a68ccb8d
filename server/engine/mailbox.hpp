#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <type_traits>

namespace drivebench {

/// Passes the newest value from one writer thread to one reader thread; older values are lost. Wait-free,
/// with three slots: one of the writer, one of the reader, and a third that they exchange.
template <class T>
class Mailbox {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  void write(const T& value) noexcept {
    slots_[write_] = value;
    write_ = middle_.exchange(write_ | kNew, std::memory_order_acq_rel) & kIndex;
  }

  /// The last written value, unless it has been taken.
  std::optional<T> take() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kNew) == 0) return std::nullopt;
    read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    return slots_[read_];
  }

 private:
  static constexpr std::uint32_t kIndex = 3;
  static constexpr std::uint32_t kNew = 4;

  std::array<T, 3> slots_{};
  std::uint32_t write_ = 0;
  std::atomic<std::uint32_t> middle_{1};
  std::uint32_t read_ = 2;
};

}  // namespace drivebench
