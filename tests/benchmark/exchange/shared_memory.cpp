#include <drivebench_bridge.h>
#include <fmt/core.h>
#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>

#include "clients/command/common/programs/installation.hpp"
#include "protocols/shm/segment.hpp"
#include "tests/benchmark/exchange/controller.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/child.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::shared_memory {
namespace {

constexpr double kMaxSpinningUs = 1.5;
constexpr double kMaxP50Ratio = 1.2;
constexpr double kMaxP99Ratio = 2.0;
constexpr std::size_t kRounds = 10;

/// The floor: two processes that wake each other by a futex and do nothing else.
class FutexPingPong {
 public:
  FutexPingPong()
      : words_(static_cast<Words*>(
            ::mmap(nullptr, sizeof(Words), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {
    check(words_ != MAP_FAILED, "mmap");
    child_ = std::make_unique<Child>([this] {
      for (std::uint32_t number = 1;; ++number) {
        await(words_->ping, number);
        tell(words_->pong, number);
      }
    });
  }
  ~FutexPingPong() {
    child_.reset();
    ::munmap(words_, sizeof(Words));
  }
  FutexPingPong(const FutexPingPong&) = delete;
  FutexPingPong& operator=(const FutexPingPong&) = delete;

  void exchange() {
    tell(words_->ping, ++number_);
    await(words_->pong, number_);
  }

 private:
  using Word = std::atomic<std::uint32_t>;
  struct Words {
    alignas(64) Word ping{0};
    alignas(64) Word pong{0};
  };

  static void await(Word& word, std::uint32_t number) {
    for (std::uint32_t seen = word.load(); seen != number; seen = word.load())
      ::syscall(SYS_futex, &word, FUTEX_WAIT, seen, nullptr, nullptr, 0);
  }
  static void tell(Word& word, std::uint32_t number) {
    word.store(number);
    ::syscall(SYS_futex, &word, FUTEX_WAKE, 1, nullptr, nullptr, 0);
  }

  Words* words_;
  std::unique_ptr<Child> child_;
  std::uint32_t number_ = 0;
};

/// A program at gate level in another process than the plant.
class GateCaller {
 public:
  explicit GateCaller(const std::string& address) {
    if (drivebench_bridge_open(address.c_str(), 0, &bridge_) != DRIVEBENCH_OK)
      throw std::runtime_error(drivebench_bridge_error(nullptr));
  }
  ~GateCaller() { drivebench_bridge_close(bridge_); }
  GateCaller(const GateCaller&) = delete;
  GateCaller& operator=(const GateCaller&) = delete;

  /// A run of a picosecond, in which nothing is due.
  void call() { drivebench_bridge_run(bridge_, now_ + 1, nullptr, 0, nullptr, &now_); }

 private:
  drivebench_bridge* bridge_ = nullptr;
  std::uint64_t now_ = 0;
};

struct Round {
  Percentiles floor, sleeping, spinning, gates;
};

Row row(const std::string& name, const Rounds<Round>& rounds, Percentiles Round::*way,
        double Percentiles::*figure, std::optional<Limit> limit, std::string note = {}) {
  const auto figure_of = [figure](Percentiles Round::*each) {
    return [each, figure](const Round& round) { return round.*each.*figure; };
  };
  return {.name = name,
          .unit = "us",
          .measured = median(rounds.results, figure_of(way)),
          .floor = median(rounds.results, figure_of(&Round::floor)),
          .limit = limit,
          .disturbance = rounds.disturbance,
          .note = std::move(note)};
}

}  // namespace

std::vector<Row> measure() {
  const CpuPair cpu = cpu_pair();
  const ScratchFolder folder;
  const std::string bench = command::find_config("servo").string();
  const std::string sleeper = folder / "sleeper.socket";
  const std::string spinner = folder / "spinner.socket";

  // Started while pinned, which they inherit.
  auto pinned = std::make_unique<Pinned>(cpu.far);
  FutexPingPong floor;
  Server sleeping_server({bench, "--unix", sleeper});
  Server spinning_server({bench, "--unix", spinner});
  const std::string board = folder / "gates.socket";
  Server gate_server({command::find_config("esc").string(), "--mode", "lockstep", "--unix", board});
  GateCaller gates("shm:" + board + "?spin_us=" + std::to_string(shm::kMaxSpinUs));
  Controller sleeping("shm:" + sleeper + "?spin_us=0");
  Controller spinning("shm:" + spinner + "?spin_us=" + std::to_string(shm::kMaxSpinUs));
  pinned.reset();

  const Pinned here(cpu.near);
  const std::array cpus{cpu.near, cpu.far};
  const Rounds<Round> rounds = undisturbed_rounds(cpus, kRounds, [&]() -> Round {
    return {.floor = time_exchanges(kBlock, [&] { floor.exchange(); }),
            .sleeping = time_exchanges(kBlock, [&] { sleeping.exchange(); }),
            .spinning = time_exchanges(kBlock, [&] { spinning.exchange(); }),
            .gates = time_exchanges(kBlock, [&] { gates.call(); })};
  });
  constexpr auto kP50 = &Percentiles::p50;
  constexpr auto kP99 = &Percentiles::p99;
  constexpr auto kRatio = Limit::Kind::kRatioAtMost;
  return {row("exchange shm, spinning, p50", rounds, &Round::spinning, kP50,
              Limit{Limit::Kind::kAtMost, kMaxSpinningUs}, "the tick included; floor: bare futex ping-pong"),
          row("exchange shm, spinning, p99", rounds, &Round::spinning, kP99, Limit{kRatio, kMaxP99Ratio}),
          row("gate level shm, spinning, p50", rounds, &Round::gates, kP50,
              Limit{Limit::Kind::kAtMost, kMaxSpinningUs}, "a run with nothing due"),
          row("exchange shm, sleeping, p50", rounds, &Round::sleeping, kP50, Limit{kRatio, kMaxP50Ratio}),
          row("exchange shm, sleeping, p99", rounds, &Round::sleeping, kP99, Limit{kRatio, kMaxP99Ratio})};
}

}  // namespace drivebench::speed::shared_memory
