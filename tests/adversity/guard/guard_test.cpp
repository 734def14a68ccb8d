// The tick calls nothing that could wait, allocate or enter the kernel, and touches no new memory. Runs under
// the preloaded guard (guard.cpp): main() starts the program again with it.
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>

#include "server/engine/engine.hpp"
#include "server/engine/mailbox.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/spsc_queue.hpp"
#include "tests/adversity/guard/guarded.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::guard_test {
namespace {

constexpr Tick kTicks = 1'000'000;
constexpr Owner kOwner = 1;
constexpr Multisine kMultisine{.quantity = Multisine::Quantity::kCurrentOffset,
                               .periods = 2,
                               .amplitude = 1e-3,
                               .lines = {.period_ticks = 100, .lowest = 1, .highest = 40, .ratio = 1.25}};

/// The run of a controller that commands every tick, in batches, between which the other threads run.
class BusyRun {
 public:
  explicit BusyRun(Bench& bench) : bench_(bench) {
    for (std::uint32_t axis = 0; axis < 2; ++axis)
      bench_.submit({.tick = 0, .axis = axis, .owner = kOwner, .action = LeaseAction::kAcquire});
  }

  void batch() noexcept {
    for (Tick n = 0; n < kBatch; ++n) {
      const Tick tick = bench_.tick();
      if (tick % 500 == 0) {  // inputs that come through the queue of requests
        requests_.push({.tick = tick + 100, .axis = 0, .owner = kOwner, .action = LoadChange{0.01, 50}});
        requests_.push({.tick = 0, .axis = 1, .owner = kOwner, .action = write_});
        requests_.push({.tick = tick + 7, .axis = 0, .owner = kOwner, .action = ramp_});
        requests_.push({.tick = tick + 50, .axis = 0, .owner = kOwner, .action = fault_of("bus_sag", 0.1)});
        requests_.push({.tick = tick + 90, .axis = 0, .owner = kOwner, .action = fault_of("bus_sag", 0.0)});
        requests_.push({.tick = tick + 60, .axis = 1, .owner = kOwner, .action = ShaftBump{1e-7}});
        requests_.push({.tick = tick + 70, .axis = 1, .owner = kOwner, .action = kMultisine});
        requests_.push({.tick = 0, .axis = 1, .owner = kOwner, .action = ClearFaults{}});
        requests_.push({.tick = 0, .axis = 0, .owner = kOwner, .action = RefusedCommand{}});
        requests_.push({.tick = 0, .axis = 0, .owner = 99, .action = RefusedCommand{}});  // a stranger's
        requests_.push({.tick = 0, .axis = 0, .owner = 0, .action = LateTick{}});
      }
      while (const Input* request = requests_.front()) {
        bench_.submit(*request);
        requests_.pop();
      }
      for (std::uint32_t axis = 0; axis < 2; ++axis) {
        const double sign = (tick >> 6 & 1) != 0 ? 1.0 : -1.0;
        Command command = voltage(tick, 40.0 * sign, (tick >> 5 & 1) != 0 ? 40.0 : -40.0);
        if (tick % 4096 > 3900) command.phases.gates = Gates::kOff;
        mailbox_.write(command);
        bench_.submit({.tick = tick, .axis = axis, .owner = kOwner, .action = *mailbox_.take()});
      }
      bench_.step();
    }
  }

 private:
  Bench& bench_;
  const ParameterWrite write_ = write_of(servo_axis(), "machine.rotor_resistance_ohm", 3.9);
  const ParameterWrite ramp_ = write_of(servo_axis(), "machine.stator_resistance_ohm", 1.7, 300);
  SpscQueue<Input> requests_{256};
  Mailbox<Command> mailbox_;
};

// Catches: an allocation, a lock, a read, a write or a look at the clock inside a tick. RT-01.
TEST(TickGuard, RT_01_AMillionTicksCallNothingThatCouldWait) {
  const Guard guard;
  const TestFolder folder;
  const BenchConfig config = busy_bench();
  Recorder recorder(folder / "run.mcap", config);
  Tap tap(&recorder);
  Bench bench(config.setup, &tap);
  BusyRun run(bench);
  std::uint64_t hits = 0;
  std::uint64_t edges = 0;
  for (Tick done = 0; done < kTicks; done += kBatch) {
    tap.drain();
    const std::int64_t before = bench.sample(0).encoder_count;
    guard.begin();
    run.batch();
    guard.end();
    hits += guard.hits();
    ASSERT_EQ(hits, 0u) << guard.first_hit() << " after tick " << done;
    if (bench.sample(0).encoder_count != before) ++edges;
  }
  recorder.finish({.ticks = static_cast<std::uint64_t>(kTicks)});
  EXPECT_EQ(recorder.gaps(), 0u);
  EXPECT_EQ(bench.sample(0).refused_commands, static_cast<std::uint64_t>(kTicks) / 500);
  EXPECT_GT(edges, 100u) << "the shaft must move, or the encoder does no work";
}

/// A run in which every fault begins and ends while live parameters ramp back to their own values.
class HostileRun {
 public:
  explicit HostileRun(Bench& bench) : bench_(bench) {
    for (std::uint32_t axis = 0; axis < bench_.axis_count(); ++axis)
      submit(axis, LeaseAction::kAcquire);
  }

  void batch() noexcept {
    for (Tick n = 0; n < kBatch; ++n) {
      for (std::uint32_t axis = 0; axis < bench_.axis_count(); ++axis)
        disturb(axis);
      bench_.step();
    }
  }

 private:
  void submit(std::uint32_t axis, const Action& action) noexcept {
    bench_.submit({.tick = bench_.tick(), .axis = axis, .owner = kOwner, .action = action});
  }

  void disturb(std::uint32_t axis) noexcept {
    const Tick tick = bench_.tick();
    const AxisParameters& p = bench_.axis(axis).parameters();
    const auto row = static_cast<std::uint32_t>(tick / 20 % static_cast<Tick>(kInjectableFaultCount));
    const InjectableFault& fault = kInjectableFaults[row];
    if (tick % 20 == 0)
      submit(axis, InjectFault{.row = row, .value = fault.integer ? 1.0 : 0.1 * fault.maximum});
    if (tick % 20 == 15) submit(axis, InjectFault{.row = row, .value = 0.0});
    if (tick % 20 == 17) submit(axis, ClearFaults{});
    const std::span<const Parameter> rows = axis_parameters(p);
    const auto changing = static_cast<std::uint32_t>(tick % static_cast<Tick>(rows.size()));
    if (rows[changing].live) {
      submit(axis, ParameterWrite{.row = changing, .value = rows[changing].get(p), .ramp_ticks = tick % 3});
    }
    const bool currents = p.drive.kind == DriveKind::kCurrent;
    const double most = currents ? p.drive.current_loop.limit_a : p.drive.amplifier.voltage_limit_v;
    const double sign = (tick >> 4 & 1) != 0 ? 0.4 : -0.4;
    const PhaseValues setpoint{.a = sign * most, .b = -sign * most, .c = 0.3 * most, .field = 0.1};
    const Gates on = currents ? Gates::kCurrent : Gates::kVoltage;
    submit(axis, Command{.answers = tick,
                         .phases = {.gates = tick % 70 > 60 ? Gates::kOff : on, .setpoint = setpoint}});
  }

  Bench& bench_;
};

// Catches: a machine, drive, sensor, fault, ramp or shared shaft that allocates, locks or looks at the clock.
TEST(TickGuard, RT_01_NoBenchCallsAnythingThatCouldWait) {
  const Guard guard;
  for (const auto& entry : std::filesystem::directory_iterator(DRIVEBENCH_BENCHES)) {
    const BenchConfig config = load_config(entry.path());
    Tap tap(nullptr);
    Bench bench(config.setup, &tap);
    schedule_events(config, bench);
    HostileRun run(bench);
    bool moved = false;
    for (Tick done = 0; done < 4000; done += kBatch) {
      tap.drain();
      guard.begin();
      run.batch();
      guard.end();
      ASSERT_EQ(guard.hits(), 0u) << guard.first_hit() << " in " << entry.path() << " before tick "
                                  << bench.tick();
      moved = moved || bench.sample(0).true_i_a_a != 0.0 || bench.sample(0).true_i_f_a != 0.0;
    }
    EXPECT_TRUE(moved) << entry.path();
  }
}

/// A deed that a tick must not do, and its observers: the guard replaces functions, the kernel sees system
/// calls.
struct Misdeed {
  const char* name;
  bool guard_sees;
  bool kernel_sees;
  void (*commit)();
};
std::mutex some_mutex;
int* volatile some_memory = nullptr;

constexpr auto kMisdeeds = std::to_array<Misdeed>({
    {"allocates", true, false,
     [] {
       some_memory = new int(3);
       delete some_memory;
     }},
    {"locks", true, false, [] { const std::lock_guard lock(some_mutex); }},
    {"looks at the clock", true, false,
     [] { [[maybe_unused]] const auto now = std::chrono::steady_clock::now(); }},
    {"writes", true, true, [] { [[maybe_unused]] const ssize_t n = ::write(-1, "x", 1); }},
    {"sleeps", true, true,
     [] {
       const timespec t{.tv_sec = 0, .tv_nsec = 1};
       nanosleep(&t, nullptr);
     }},
    {"enters the kernel unseen", false, true, [] { ::syscall(SYS_getppid); }},
});

class BadTap final : public Tap {
 public:
  explicit BadTap(const Misdeed& misdeed) : Tap(nullptr), misdeed_(misdeed) {}
  void on_sample(std::uint32_t axis, const Sample& sample) noexcept override {
    Tap::on_sample(axis, sample);
    if (armed && sample.tick % 10 == 0) misdeed_.commit();
  }
  bool armed = false;

 private:
  const Misdeed& misdeed_;
};

// Catches: a guard that sees nothing.
TEST(TickGuard, TheGuardReportsEveryForbiddenCall) {
  const Guard guard;
  for (const Misdeed& misdeed : kMisdeeds) {
    BadTap tap(misdeed);
    const BenchConfig config = busy_bench();
    Bench bench(config.setup, &tap);
    BusyRun run(bench);
    tap.armed = true;
    guard.begin();
    run.batch();
    guard.end();
    const auto times = static_cast<std::uint64_t>(kBatch) / 10;
    EXPECT_GE(guard.hits(), misdeed.guard_sees ? times : 0) << misdeed.name;
    tap.armed = false;
  }
}

/// From here on any system call but exit_group ends the process with SIGSYS. False if the kernel has no such
/// filter.
bool forbid_system_calls() {
  std::array<sock_filter, 4> program{{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit_group, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
  }};
  const sock_fprog filter{.len = program.size(), .filter = program.data()};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

constexpr int kNoFilter = 77;

/// The wait status of a child that runs a bench without system calls.
int run_in_a_child(Tap& tap, Tick ticks, bool* armed) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const BenchConfig config = busy_bench();
    Bench bench(config.setup, &tap);
    BusyRun run(bench);
    run.batch();  // memory that is still shared with the parent gets its copy here
    if (armed != nullptr) *armed = true;
    if (!forbid_system_calls()) _exit(kNoFilter);
    for (Tick done = 0; done < ticks; done += kBatch) {
      run.batch();
      tap.drain();
    }
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

// Catches: a system call inside a tick, made in any way.
TEST(TickGuard, RT_03_AMillionTicksMakeNoSystemCall) {
  Tap tap(nullptr);
  const int status = run_in_a_child(tap, kTicks, nullptr);
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNoFilter) GTEST_SKIP() << "no seccomp filters here";
  EXPECT_TRUE(WIFEXITED(status)) << "ended by signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0);

  for (const Misdeed& misdeed : kMisdeeds) {
    if (!misdeed.kernel_sees) continue;
    BadTap bad(misdeed);
    const int ended = run_in_a_child(bad, kBatch, &bad.armed);
    EXPECT_TRUE(WIFSIGNALED(ended) && WTERMSIG(ended) == SIGSYS) << misdeed.name << " is not caught";
  }
}

rusage usage() {
  rusage u{};
  getrusage(RUSAGE_THREAD, &u);
  return u;
}

// Catches: memory that a tick touches for the first time. RT-02. The kernel may take a page away for its own
// reasons, so one round of three without a fault must suffice.
TEST(TickGuard, RT_02_AMillionTicksTouchNoNewMemory) {
  Tap tap(nullptr);
  const BenchConfig config = busy_bench();
  Bench bench(config.setup, &tap);
  BusyRun run(bench);
  for (int n = 0; n < 10; ++n) {
    run.batch();
    tap.drain();
  }
  long faults = -1;
  for (int round = 0; round < 3 && faults != 0; ++round) {
    const rusage before = usage();
    for (Tick done = 0; done < kTicks; done += kBatch) {
      run.batch();
      tap.drain();
    }
    const rusage after = usage();
    faults = after.ru_minflt - before.ru_minflt + after.ru_majflt - before.ru_majflt;
  }
  EXPECT_EQ(faults, 0);

  // The count sees a page that is touched for the first time.
  const rusage before = usage();
  const auto fresh = std::make_unique<char[]>(std::size_t{1} << 24);
  EXPECT_GT(usage().ru_minflt, before.ru_minflt) << static_cast<int>(fresh[1]);
}

}  // namespace
}  // namespace drivebench::guard_test
