#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "protocols/shm/segment.hpp"

namespace drivebench {

/// The bench's side of the memory that it shares with one session. The memory has no name, so that no other
/// program finds it and nothing is left behind, and its size is sealed, so that a client cannot take it from
/// under the bench.
class SharedSegment {
 public:
  /// Throws std::system_error if the system gives no memory or no descriptors.
  explicit SharedSegment(std::size_t axes);
  ~SharedSegment();
  SharedSegment(const SharedSegment&) = delete;
  SharedSegment& operator=(const SharedSegment&) = delete;

  std::size_t bytes() const noexcept { return bytes_; }
  shm::Request& request() noexcept { return segment_->request; }
  shm::Reply& reply() noexcept { return segment_->reply; }
  shm::SampleRecord* samples() noexcept { return shm::samples_of(*segment_); }

  /// The bench's end of the bell, which does not block; the caller closes it. The client has the other end,
  /// and so no hold on this one.
  int take_bell() noexcept;
  /// Sends the bytes over a unix socket, and with the first of them the memory and the client's end of the
  /// bell. Returns how many bytes were sent; -1: none, and errno says why.
  std::ptrdiff_t send_with(int socket, const void* bytes, std::size_t size) noexcept;
  /// Takes the pages back, which a client that has gone might keep for ever.
  void forget() noexcept;
  /// Wakes a client that sleeps.
  void wake_client() noexcept;

 private:
  std::size_t bytes_;
  int memory_ = -1;
  int bell_ = -1;  // the bench's end
  int client_bell_ = -1;
  shm::Segment* segment_ = nullptr;
};

}  // namespace drivebench
