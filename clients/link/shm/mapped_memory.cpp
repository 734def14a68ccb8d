#include "clients/link/shm/mapped_memory.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "clients/link/common/address.hpp"

namespace drivebench::link {
namespace {

/// The size of the memory; 0 if another program could make it shorter.
std::size_t sealed_size(int memory) noexcept {
  struct stat facts {};
  const int seals = ::fcntl(memory, F_GET_SEALS);
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || ::fstat(memory, &facts) != 0) return 0;
  return static_cast<std::size_t>(facts.st_size);
}

}  // namespace

MappedMemory::MappedMemory(const FileDescriptor& memory, std::size_t head_bytes, const std::string& peer)
    : bytes_(sealed_size(memory.get())) {
  if (bytes_ == 0) refuse_memory(peer, "another program could make shorter");
  if (bytes_ < head_bytes) refuse_memory(peer, "is shorter than its head");
  address_ = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, memory.get(), 0);
  if (address_ == MAP_FAILED) refuse_memory(peer, "cannot be mapped");
}

MappedMemory::~MappedMemory() {
  ::munmap(address_, bytes_);
}

void refuse_memory(const std::string& peer, std::string_view what) {
  throw LinkError(peer + " shared memory that " + std::string(what));
}

}  // namespace drivebench::link
