#include "clients/link/shm/shared_memory.hpp"

#include <sched.h>
#include <sys/socket.h>

#include <algorithm>
#include <utility>

#include "protocols/shm/fixed_text.hpp"

namespace drivebench::link {
namespace {

shm::CommandRecord record_of(const AxisCommand& c) noexcept {
  const Setpoints to = setpoints_of(c);
  return {.axis = c.axis,
          .tick = c.tick,
          .gates = c.gates,
          .legs_off = c.legs_off,
          .setpoint = {.a = to.a, .b = to.b, .c = to.c, .field = to.f},
          .edges = c.edges};
}

}  // namespace

SharedMemory::SharedMemory(const FileDescriptor& memory, FileDescriptor bell, int socket,
                           std::chrono::microseconds spin, const std::string& peer)
    : memory_(memory, sizeof(shm::Segment), peer),
      segment_(static_cast<shm::Segment*>(memory_.address())),
      bell_(std::move(bell)),
      wait_{.spin = spin, .socket = socket} {
  const shm::Head head = segment_->head;
  axes_ = head.axes;
  const bool is_ours = head.version == shm::kVersion && head.sample_words == kSampleWords &&
                       axes_ <= shm::kMaxAxes && memory_.bytes() == shm::segment_bytes(axes_);
  if (head.magic != shm::kMagic) refuse_memory(peer, "is not that of a bench");
  if (!is_ours) refuse_memory(peer, "has another layout: bench and client are of different versions");
}

SharedMemory::Outcome SharedMemory::exchange(std::span<const AxisCommand> commands,
                                             std::chrono::milliseconds deadline) {
  shm::Request& request = segment_->request;
  const std::size_t count = std::min(commands.size(), shm::kMaxAxes);
  for (std::size_t i = 0; i < count; ++i)
    request.commands[i] = record_of(commands[i]);
  request.count = commands.size();  // one too many is refused by the bench
  request.cpu = ::sched_getcpu();
  request.number.store(++number_);
  if (segment_->reply.asleep.load() != 0) {
    static_cast<void>(::send(bell_.get(), "", 1, MSG_DONTWAIT | MSG_NOSIGNAL));  // a full one rings as well
  }
  const shm::Reply& reply = segment_->reply;
  switch (wait_.await(reply.number, number_, request.waits, reply.cpu != request.cpu, deadline)) {
    case AnswerWait::End::kAnswered:
      return outcome();
    case AnswerWait::End::kTooLate:
      return Outcome::kTooLate;
    case AnswerWait::End::kSessionOver:
      break;
  }
  return Outcome::kSessionOver;
}

SharedMemory::Outcome SharedMemory::outcome() {
  const shm::Reply& reply = segment_->reply;
  if (reply.code != 0) return Outcome::kRefused;
  const std::size_t count = std::min<std::size_t>(std::uint64_t{reply.count}, axes_);
  const shm::SampleRecord* const from = shm::samples_of(*segment_);
  samples_.assign(from, from + count);
  // Not before the copy, as a plain load could be: a bench takes its memory back at the end of the session.
  std::uint32_t number = number_;
  const bool is_still_there = segment_->reply.number.compare_exchange_strong(number, number);
  return is_still_there ? Outcome::kSamples : Outcome::kSessionOver;
}

v1::Refusal SharedMemory::refusal() const {
  v1::Refusal refusal;
  refusal.set_code(static_cast<v1::RefusalCode>(segment_->reply.code));
  refusal.set_message(shm::text_in(segment_->reply.sentence));
  refusal.set_field(shm::text_in(segment_->reply.field));
  return refusal;
}

}  // namespace drivebench::link
