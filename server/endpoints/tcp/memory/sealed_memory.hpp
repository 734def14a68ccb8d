#pragma once

#include <cstddef>
#include <span>

namespace drivebench {

/// Memory that the server shares with one session. It has no name, so that no other program finds it and
/// nothing is left behind, and its size is sealed, so that a client cannot take it from under the bench.
class SealedMemory {
 public:
  /// Throws std::system_error if the system gives no memory or no descriptor.
  explicit SealedMemory(std::size_t bytes);
  ~SealedMemory();
  SealedMemory(const SealedMemory&) = delete;
  SealedMemory& operator=(const SealedMemory&) = delete;

  std::size_t bytes() const noexcept { return bytes_; }
  void* address() const noexcept { return address_; }

  /// Sends the bytes over a unix socket, and with the first of them the memory and one more descriptor if
  /// there is one (not -1). Returns how many bytes were sent; -1: none, and errno says why.
  std::ptrdiff_t send_with(int socket, std::span<const std::byte> bytes, int descriptor = -1) const noexcept;
  /// Takes the pages back, which a client that has gone might keep for ever.
  void forget() noexcept;

 private:
  std::size_t bytes_;
  int file_ = -1;
  void* address_ = nullptr;
};

}  // namespace drivebench
