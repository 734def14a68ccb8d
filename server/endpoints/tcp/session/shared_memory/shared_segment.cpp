#include "server/endpoints/tcp/session/shared_memory/shared_segment.hpp"

#include <fcntl.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <limits>
#include <new>
#include <system_error>
#include <utility>

namespace drivebench {

SharedSegment::SharedSegment(std::size_t axes) : bytes_(shm::segment_bytes(axes)) {
  const auto fail = [this](const char* what) {
    const int why = errno;
    if (memory_ >= 0) ::close(memory_);
    if (bell_ >= 0) ::close(bell_);
    if (client_bell_ >= 0) ::close(client_bell_);
    throw std::system_error(why, std::generic_category(), what);
  };
  memory_ = ::memfd_create("drivebench", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (memory_ < 0) fail("no memory to share");
  std::array<int, 2> bell{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, bell.data()) != 0) {
    fail("no descriptors for the bell");
  }
  bell_ = bell[0];
  client_bell_ = bell[1];
  if (::ftruncate(memory_, static_cast<off_t>(bytes_)) != 0) fail("no memory to share");
  if (::fcntl(memory_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
    fail("the size of shared memory cannot be fixed");
  }
  void* const memory = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, memory_, 0);
  if (memory == MAP_FAILED) fail("no memory to share");
  segment_ = new (memory) shm::Segment;
  segment_->head.axes = axes;
}

SharedSegment::~SharedSegment() {
  ::munmap(segment_, bytes_);
  if (memory_ >= 0) ::close(memory_);
  if (bell_ >= 0) ::close(bell_);
  if (client_bell_ >= 0) ::close(client_bell_);
}

int SharedSegment::take_bell() noexcept {
  return std::exchange(bell_, -1);
}

std::ptrdiff_t SharedSegment::send_with(int socket, const void* bytes, std::size_t size) noexcept {
  const std::array<int, 2> descriptors{memory_, client_bell_};
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof descriptors)> control{};
  iovec part{.iov_base = const_cast<void*>(bytes), .iov_len = size};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* const rights = CMSG_FIRSTHDR(&message);
  rights->cmsg_level = SOL_SOCKET;
  rights->cmsg_type = SCM_RIGHTS;
  rights->cmsg_len = CMSG_LEN(sizeof descriptors);
  std::memcpy(CMSG_DATA(rights), descriptors.data(), sizeof descriptors);
  const std::ptrdiff_t sent = ::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
  if (sent >= 0) ::close(std::exchange(client_bell_, -1));
  return sent;
}

void SharedSegment::forget() noexcept {
  ::fallocate(memory_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, static_cast<off_t>(bytes_));
}

void SharedSegment::wake_client() noexcept {
  ::syscall(SYS_futex, &segment_->reply.number, FUTEX_WAKE, std::numeric_limits<int>::max(), nullptr, nullptr,
            0);
}

}  // namespace drivebench
