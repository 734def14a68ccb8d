#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>

#include "clients/link/common/file_descriptor.hpp"
#include "clients/link/shm/answer_wait.hpp"
#include "clients/link/shm/mapped_memory.hpp"
#include "protocols/shm/bridge_segment.hpp"

namespace drivebench::link {

/// The client's side of the memory of a bridge at gate level (protocols/shm/bridge_segment.hpp).
class BridgeMemory {
 public:
  /// Throws LinkError if it is none of a bench of this build. `socket` belongs to the session, whose end it
  /// shows.
  BridgeMemory(const FileDescriptor& memory, int socket, std::chrono::microseconds spin, std::string peer);

  /// The arguments of the next call, and where a state to restore goes.
  shm::BridgeArguments& arguments() noexcept { return segment_.request.arguments; }
  std::byte* bytes() noexcept { return segment_.bytes.data(); }
  /// Has the call carried out and shows its results. Throws LinkError when the session has ended.
  template <class Take>
  void call(Take take) {
    ask();
    take(std::as_const(segment_.reply));
    require_memory();
  }

 private:
  void ask();
  /// The bench takes its memory back at the end of the session: then what was read means nothing.
  void require_memory();

  std::string peer_;
  MappedMemory memory_;
  shm::BridgeSegment& segment_;
  AnswerWait wait_;
  std::uint32_t number_ = 0;  // of the last call
};

}  // namespace drivebench::link
