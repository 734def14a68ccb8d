#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>

#include "protocols/shm/segment.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace drivebench::fuzz {

/// A client's mapping of the memory that its session shares; closes both descriptors.
class PeerMemory {
 public:
  PeerMemory(int memory, int bell) : bell_(bell) {
    struct stat facts {};
    require(::fstat(memory, &facts) == 0 && (::fcntl(memory, F_GET_SEALS) & F_SEAL_SHRINK) != 0,
            "shared memory has a size that nobody can change");
    bytes_ = static_cast<std::size_t>(facts.st_size);
    void* const address = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0);
    require(address != MAP_FAILED, "shared memory can be mapped");
    ::close(memory);
    segment_ = static_cast<shm::Segment*>(address);
  }
  ~PeerMemory() {
    ::munmap(segment_, bytes_);
    ::close(bell_);
  }
  PeerMemory(const PeerMemory&) = delete;
  PeerMemory& operator=(const PeerMemory&) = delete;

  shm::Segment& segment() noexcept { return *segment_; }
  void ring() const { static_cast<void>(::send(bell_, "", 1, MSG_DONTWAIT | MSG_NOSIGNAL)); }

 private:
  int bell_;
  std::size_t bytes_ = 0;
  shm::Segment* segment_ = nullptr;
};

}  // namespace drivebench::fuzz
