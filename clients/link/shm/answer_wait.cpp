#include "clients/link/shm/answer_wait.hpp"

#include <poll.h>

#include <algorithm>

#include "protocols/shm/futex.hpp"
#include "protocols/shm/segment.hpp"

namespace drivebench::link {
namespace {

using Clock = std::chrono::steady_clock;

/// The longest sleep without a look at the session.
constexpr std::chrono::milliseconds kLook{100};

bool has_ended(int socket) noexcept {
  pollfd session{.fd = socket, .events = POLLRDHUP, .revents = 0};
  return ::poll(&session, 1, 0) > 0;
}

}  // namespace

AnswerWait::End AnswerWait::await(const std::atomic<std::uint32_t>& bench, std::uint32_t number,
                                  std::atomic<std::uint32_t>& waits, bool may_spin,
                                  std::optional<std::chrono::milliseconds> deadline) const {
  const Clock::time_point start = Clock::now();
  for (Clock::time_point now = start; may_spin && now - start < spin; now = Clock::now()) {
    for (int looks = 0; looks < 16; ++looks) {
      if (bench.load() == number) return End::kAnswered;
      shm::spin();
    }
  }
  waits.store(1);
  End end = End::kAnswered;
  for (std::uint32_t seen = bench.load(); seen != number; seen = bench.load()) {
    const auto left = deadline ? start + *deadline - Clock::now() : Clock::duration(kLook);
    if (left <= Clock::duration::zero()) {
      end = End::kTooLate;
      break;
    }
    shm::sleep_while(bench, seen, std::min<std::chrono::nanoseconds>(left, kLook));
    if (bench.load() != number && has_ended(socket)) {
      end = End::kSessionOver;
      break;
    }
  }
  waits.store(0);
  return end;
}

}  // namespace drivebench::link
