#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

namespace drivebench::web {

/// The frames that wait for a browser, as one message. While it reads too slowly, samples of subscriptions
/// are left out and added to `dropped` of the next ones that go through, as the server does; answers always
/// go through.
class SendQueue {
 public:
  static constexpr std::size_t kSamplesLimit = std::size_t{256} * 1024;
  static constexpr std::size_t kLimit = std::size_t{4} * 1024 * 1024;

  /// Adds the payload of a frame of the bench. False: the queue is full of answers, and the browser takes
  /// none.
  bool add(std::span<const std::byte> payload);

  bool is_empty() const noexcept { return message_.empty(); }
  /// Swaps the message for an empty one.
  void take(std::vector<std::byte>& message) noexcept;

 private:
  bool put(std::span<const std::byte> payload);
  bool add_slowly(std::span<const std::byte> payload);

  std::vector<std::byte> message_;
  std::map<std::uint32_t, std::uint64_t> lost_;  // samples that no message has told yet, by axis
};

}  // namespace drivebench::web
