#include "clients/link/shm/shared_memory.hpp"

#include <fcntl.h>
#include <linux/futex.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>

#include <algorithm>
#include <cstring>
#include <ctime>
#include <string_view>
#include <utility>

#include "clients/link/common/address.hpp"

namespace drivebench::link {
namespace {

/// The longest sleep without a look at the session.
constexpr auto kLook = std::chrono::milliseconds(100);

shm::CommandRecord record_of(const AxisCommand& c) noexcept {
  const Setpoints to = setpoints_of(c);
  return {.axis = c.axis,
          .tick = c.tick,
          .gates = c.gates,
          .legs_off = c.legs_off,
          .setpoint = {.a = to.a, .b = to.b, .c = to.c, .field = to.f},
          .edges = c.edges};
}

/// A text that the bench has written; it ends at its zero or with the array.
template <std::size_t n>
std::string text_in(const std::array<char, n>& from) {
  return {from.data(), ::strnlen(from.data(), n)};
}

bool has_ended(int socket) noexcept {
  pollfd session{.fd = socket, .events = POLLRDHUP, .revents = 0};
  return ::poll(&session, 1, 0) > 0;
}

/// The size of the memory; 0 if another program could make it shorter.
std::size_t sealed_size(int memory) noexcept {
  struct stat facts {};
  const int seals = ::fcntl(memory, F_GET_SEALS);
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || ::fstat(memory, &facts) != 0) return 0;
  return static_cast<std::size_t>(facts.st_size);
}

}  // namespace

SharedMemory::SharedMemory(const FileDescriptor& memory, FileDescriptor bell, int socket,
                           std::chrono::microseconds spin, const std::string& peer)
    : bytes_(sealed_size(memory.get())), bell_(std::move(bell)), socket_(socket), spin_(spin) {
  const auto fail = [&peer](std::string_view what) {
    throw LinkError(peer + " shared memory that " + std::string(what));
  };
  if (bytes_ == 0) fail("another program could make shorter");
  if (bytes_ < sizeof(shm::Segment)) fail("is shorter than its head");
  void* const address =
      ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, memory.get(), 0);
  if (address == MAP_FAILED) fail("cannot be mapped");
  segment_ = static_cast<shm::Segment*>(address);
  const shm::Head head = segment_->head;
  axes_ = head.axes;
  const bool is_ours = head.magic == shm::kMagic && head.version == shm::kVersion &&
                       head.sample_words == kSampleWords && axes_ <= shm::kMaxAxes &&
                       bytes_ == shm::segment_bytes(axes_);
  if (is_ours) return;
  ::munmap(address, bytes_);
  fail(head.magic == shm::kMagic ? "has another layout: bench and client are of different versions"
                                 : "is not that of a bench");
}

SharedMemory::~SharedMemory() {
  ::munmap(segment_, bytes_);
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
  return await_answer(deadline);
}

SharedMemory::Outcome SharedMemory::await_answer(std::chrono::milliseconds deadline) {
  const Clock::time_point start = Clock::now();
  const bool may_spin = segment_->reply.cpu != segment_->request.cpu;
  for (Clock::time_point now = start; may_spin && now - start < spin_; now = Clock::now()) {
    for (int looks = 0; looks < 16; ++looks) {
      if (is_answered()) return outcome();
      shm::spin();
    }
  }
  shm::Request& request = segment_->request;
  request.waits.store(1);
  const Outcome result = sleep_until_answered(start + deadline);
  request.waits.store(0);
  return result;
}

SharedMemory::Outcome SharedMemory::sleep_until_answered(Clock::time_point give_up) {
  for (;;) {
    const std::uint32_t seen = segment_->reply.number.load();
    if (seen == number_) return outcome();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(give_up - Clock::now());
    if (left.count() <= 0) return Outcome::kTooLate;
    const timespec wait{.tv_sec = 0, .tv_nsec = std::min(left, kLook).count() * 1'000'000};
    ::syscall(SYS_futex, &segment_->reply.number, FUTEX_WAIT, seen, &wait, nullptr, 0);
    if (!is_answered() && has_ended(socket_)) return Outcome::kSessionOver;
  }
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
  refusal.set_message(text_in(segment_->reply.sentence));
  refusal.set_field(text_in(segment_->reply.field));
  return refusal;
}

}  // namespace drivebench::link
