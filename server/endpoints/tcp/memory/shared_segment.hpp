#pragma once

#include <cstddef>

#include "protocols/shm/segment.hpp"
#include "server/endpoints/tcp/memory/sealed_memory.hpp"

namespace drivebench {

/// The bench's side of the memory for the exchanges of one session.
class SharedSegment {
 public:
  /// Throws std::system_error if the system gives no memory or no descriptors.
  explicit SharedSegment(std::size_t axes);
  ~SharedSegment();
  SharedSegment(const SharedSegment&) = delete;
  SharedSegment& operator=(const SharedSegment&) = delete;

  std::size_t bytes() const noexcept { return memory_.bytes(); }
  shm::Request& request() noexcept { return segment_->request; }
  shm::Reply& reply() noexcept { return segment_->reply; }
  shm::SampleRecord* samples() noexcept { return shm::samples_of(*segment_); }

  /// The bench's end of the bell, which does not block; the caller closes it. The client has the other end,
  /// and so no hold on this one.
  int take_bell() noexcept;
  /// Sends the bytes over a unix socket, and with the first of them the memory and the client's end of the
  /// bell. Returns how many bytes were sent; -1: none, and errno says why.
  std::ptrdiff_t send_with(int socket, std::span<const std::byte> bytes) noexcept;
  /// Takes the pages back, which a client that has gone might keep for ever.
  void forget() noexcept { memory_.forget(); }
  /// Wakes a client that sleeps.
  void wake_client() noexcept;

 private:
  SealedMemory memory_;
  int bell_ = -1;  // the bench's end
  int client_bell_ = -1;
  shm::Segment* segment_;
};

}  // namespace drivebench
