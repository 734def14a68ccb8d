#pragma once

#include <bench.pb.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clients/link/common/file_descriptor.hpp"
#include "clients/link/common/requests.hpp"
#include "clients/link/shm/answer_wait.hpp"
#include "clients/link/shm/mapped_memory.hpp"
#include "protocols/shm/segment.hpp"

namespace drivebench::link {

/// The client's side of the memory that a session shares with its bench (protocols/shm/segment.hpp).
class SharedMemory {
 public:
  /// Maps the memory. Throws LinkError if it is none of a bench of this build. `spin` is the time that
  /// exchange() looks for the answer before it sleeps; `socket` belongs to the session, whose end it shows.
  SharedMemory(const FileDescriptor& memory, FileDescriptor bell, int socket, std::chrono::microseconds spin,
               const std::string& peer);

  /// The outcome of an exchange.
  enum class Outcome { kSamples, kRefused, kTooLate, kSessionOver };
  /// See Link::exchange().
  Outcome exchange(std::span<const AxisCommand> commands, std::chrono::milliseconds deadline);
  /// After kSamples, until the next exchange.
  std::span<const shm::SampleRecord> samples() const noexcept { return samples_; }
  /// After kRefused.
  v1::Refusal refusal() const;

 private:
  Outcome outcome();

  MappedMemory memory_;
  shm::Segment* segment_;
  std::size_t axes_ = 0;
  FileDescriptor bell_;
  AnswerWait wait_;
  std::uint32_t number_ = 0;  // of the last exchange
  std::vector<shm::SampleRecord> samples_;
};

}  // namespace drivebench::link
