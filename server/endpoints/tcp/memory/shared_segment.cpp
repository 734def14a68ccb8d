#include "server/endpoints/tcp/memory/shared_segment.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <memory>
#include <system_error>
#include <utility>

#include "protocols/shm/futex.hpp"

namespace drivebench {

SharedSegment::SharedSegment(std::size_t axes)
    : memory_(shm::segment_bytes(axes)),
      segment_(std::construct_at(static_cast<shm::Segment*>(memory_.address()))) {
  segment_->head.axes = axes;
  std::array<int, 2> bell{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, bell.data()) != 0)
    throw std::system_error(errno, std::generic_category(), "no descriptors for the bell");
  bell_ = bell[0];
  client_bell_ = bell[1];
}

SharedSegment::~SharedSegment() {
  if (bell_ >= 0) ::close(bell_);
  if (client_bell_ >= 0) ::close(client_bell_);
}

int SharedSegment::take_bell() noexcept {
  return std::exchange(bell_, -1);
}

std::ptrdiff_t SharedSegment::send_with(int socket, std::span<const std::byte> bytes) noexcept {
  const std::ptrdiff_t sent = memory_.send_with(socket, bytes, client_bell_);
  if (sent >= 0) ::close(std::exchange(client_bell_, -1));
  return sent;
}

void SharedSegment::wake_client() noexcept {
  shm::wake(segment_->reply.number);
}

}  // namespace drivebench
