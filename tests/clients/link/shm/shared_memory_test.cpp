// Memory that no bench has made, or that a bench of another build has made.
#include "clients/link/shm/shared_memory.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <functional>
#include <new>
#include <thread>

#include "clients/link/common/address.hpp"

namespace drivebench::link::shared_memory_test {
namespace {

using namespace std::chrono_literals;

/// A segment as a bench makes it, whose content a test may change.
class FakeMemory {
 public:
  explicit FakeMemory(std::size_t axes = 1, bool is_sealed = true, std::size_t missing = 0)
      : memory_(::memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
    const std::size_t bytes = shm::segment_bytes(axes) - missing;
    EXPECT_EQ(::ftruncate(memory_.get(), static_cast<off_t>(bytes)), 0);
    const int seals = is_sealed ? F_SEAL_SHRINK | F_SEAL_GROW : F_SEAL_GROW;
    EXPECT_EQ(::fcntl(memory_.get(), F_ADD_SEALS, seals), 0);
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, sockets_), 0);
    if (bytes < sizeof(shm::Segment)) return;
    segment_ =
        new (::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memory_.get(), 0)) shm::Segment;
    segment_->head.axes = axes;
  }
  ~FakeMemory() {
    ::close(sockets_[0]);
    if (sockets_[1] >= 0) ::close(sockets_[1]);
  }

  shm::Segment& segment() { return *segment_; }
  std::unique_ptr<SharedMemory> open() const {
    return std::make_unique<SharedMemory>(memory_, FileDescriptor(::eventfd(0, 0)), sockets_[0], 0us, "peer");
  }
  std::string problem() const {
    try {
      open();
    } catch (const LinkError& error) {
      return error.what();
    }
    return "";
  }
  void end_session() { ::close(std::exchange(sockets_[1], -1)); }

 private:
  FileDescriptor memory_;
  shm::Segment* segment_ = nullptr;  // stays mapped: this program ends soon
  int sockets_[2]{-1, -1};
};

// Catches: a client that maps what a stranger can take away, reads beyond it, or takes another layout for its
// own.
TEST(SharedMemory, SHM_02_IsRefusedIfItIsNotThatOfABenchOfThisBuild) {
  EXPECT_EQ(FakeMemory().problem(), "");
  EXPECT_EQ(FakeMemory(shm::kMaxAxes).problem(), "");
  EXPECT_EQ(FakeMemory(1, false).problem(), "peer shared memory that another program could make shorter");
  EXPECT_EQ(FakeMemory(0, true, sizeof(shm::Segment) - 100).problem(),
            "peer shared memory that is shorter than its head");
  EXPECT_NE(FakeMemory(1, true, 8).problem(), "") << "shorter than its axes need";
  const auto problem_with = [](const std::function<void(shm::Head&)>& change) {
    FakeMemory memory;
    change(memory.segment().head);
    return memory.problem();
  };
  EXPECT_EQ(problem_with([](shm::Head& head) { head.magic = 1; }),
            "peer shared memory that is not that of a bench");
  const std::string other =
      "peer shared memory that has another layout: bench and client are of different versions";
  EXPECT_EQ(problem_with([](shm::Head& head) { ++head.version; }), other);
  EXPECT_EQ(problem_with([](shm::Head& head) { ++head.sample_words; }), other);
  EXPECT_EQ(problem_with([](shm::Head& head) { head.axes = 2; }), other);
  EXPECT_EQ(problem_with([](shm::Head& head) { head.axes = std::uint64_t{1} << 60; }), other);
}

// Catches: a client that follows a count out of the memory, or a text that has no end.
TEST(SharedMemory, ReadsNoFurtherThanItsSize) {
  FakeMemory memory;
  const auto client = memory.open();
  shm::Reply& reply = memory.segment().reply;
  reply.number = 1;
  reply.count = std::uint64_t{1} << 40;
  ASSERT_EQ(client->exchange({}, 1s), SharedMemory::Outcome::kSamples);
  EXPECT_EQ(client->samples().size(), 1u);
  reply.number = 2;
  reply.code = v1::REFUSAL_STALE;
  reply.sentence.fill('x');
  reply.field.fill('y');
  ASSERT_EQ(client->exchange({}, 1s), SharedMemory::Outcome::kRefused);
  EXPECT_EQ(client->refusal().message().size(), reply.sentence.size());
  EXPECT_EQ(client->refusal().field().size(), reply.field.size());
}

// Catches: a client that sleeps for ever when a wake-up is lost, when there is no answer, or when the session
// has ended.
TEST(SharedMemory, SHM_04_NoSleepIsForEver) {
  FakeMemory memory;
  const auto client = memory.open();
  EXPECT_EQ(client->exchange({}, 20ms), SharedMemory::Outcome::kTooLate);
  for (std::uint32_t number = 2; number < 5; ++number) {
    std::thread bench([&] {
      while (memory.segment().request.number != number)
        std::this_thread::yield();
      memory.segment().reply.number = number;  // without waking: the client looks again by itself
    });
    EXPECT_EQ(client->exchange({}, 30s), SharedMemory::Outcome::kSamples);
    bench.join();
  }
  memory.end_session();
  EXPECT_EQ(client->exchange({}, 30s), SharedMemory::Outcome::kSessionOver);
}

}  // namespace
}  // namespace drivebench::link::shared_memory_test
