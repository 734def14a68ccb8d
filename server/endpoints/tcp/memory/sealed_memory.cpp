#include "server/endpoints/tcp/memory/sealed_memory.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace drivebench {

SealedMemory::SealedMemory(std::size_t bytes) : bytes_(bytes) {
  const auto fail = [this](const char* what) {
    const int why = errno;
    if (file_ >= 0) ::close(file_);
    throw std::system_error(why, std::generic_category(), what);
  };
  file_ = ::memfd_create("drivebench", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (file_ < 0) fail("no memory to share");
  if (::ftruncate(file_, static_cast<off_t>(bytes_)) != 0) fail("no memory to share");
  if (::fcntl(file_, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0)
    fail("the size of shared memory cannot be fixed");
  address_ = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file_, 0);
  if (address_ == MAP_FAILED) fail("no memory to share");
}

SealedMemory::~SealedMemory() {
  ::munmap(address_, bytes_);
  ::close(file_);
}

std::ptrdiff_t SealedMemory::send_with(int socket, std::span<const std::byte> bytes,
                                       int descriptor) const noexcept {
  const std::array<int, 2> descriptors{file_, descriptor};
  const std::size_t size = (descriptor < 0 ? 1 : 2) * sizeof(int);
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof descriptors)> control{};
  iovec part{.iov_base = const_cast<std::byte*>(bytes.data()), .iov_len = bytes.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = CMSG_SPACE(size);
  cmsghdr* const rights = CMSG_FIRSTHDR(&message);
  rights->cmsg_level = SOL_SOCKET;
  rights->cmsg_type = SCM_RIGHTS;
  rights->cmsg_len = CMSG_LEN(size);
  std::memcpy(CMSG_DATA(rights), descriptors.data(), size);
  return ::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

void SealedMemory::forget() noexcept {
  ::fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0, static_cast<off_t>(bytes_));
}

}  // namespace drivebench
