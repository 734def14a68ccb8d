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
#include "protocols/shm/segment.hpp"

namespace drivebench::link {

/// The client's side of the memory that a session shares with its bench (protocols/shm/segment.hpp).
class SharedMemory {
 public:
  /// Maps the memory. Throws LinkError if it is none of a bench of this build. `spin` is the time that
  /// exchange() looks for the answer before it sleeps; `socket` belongs to the session, whose end it shows.
  SharedMemory(const FileDescriptor& memory, FileDescriptor bell, int socket, std::chrono::microseconds spin,
               const std::string& peer);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  /// The outcome of an exchange.
  enum class Outcome { kSamples, kRefused, kTooLate, kSessionOver };
  /// See Link::exchange().
  Outcome exchange(std::span<const AxisCommand> commands, std::chrono::milliseconds deadline);
  /// After kSamples, until the next exchange.
  std::span<const shm::SampleRecord> samples() const noexcept { return samples_; }
  /// After kRefused.
  v1::Refusal refusal() const;

 private:
  using Clock = std::chrono::steady_clock;

  bool is_answered() const noexcept { return segment_->reply.number.load() == number_; }
  Outcome await_answer(std::chrono::milliseconds deadline);
  Outcome sleep_until_answered(Clock::time_point give_up);
  Outcome outcome();

  std::size_t bytes_;
  std::size_t axes_ = 0;
  FileDescriptor bell_;
  int socket_;
  std::chrono::microseconds spin_;
  shm::Segment* segment_ = nullptr;
  std::uint32_t number_ = 0;  // of the last exchange
  std::vector<shm::SampleRecord> samples_;
};

}  // namespace drivebench::link
