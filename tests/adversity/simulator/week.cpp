// A week of plant time: the bench alone, at full speed.
#include "tests/adversity/simulator/week.hpp"

#include <malloc.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <optional>
#include <string>

#include "plant/injected_faults.hpp"
#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"
#include "server/config/config.hpp"
#include "tests/adversity/simulator/account/account.hpp"
#include "tests/adversity/simulator/world/random.hpp"

namespace drivebench::simulator {
namespace {

/// A turning voltage, as a simple inverter gives it: so many ticks a turn.
constexpr std::size_t kAngles = 256;

class Week {
 public:
  Week(const BenchConfig& config, std::uint64_t seed)
      : config_(config), random_(seed), account_(make_account()), bench_(config_.setup) {
    double a = 20.0;
    double b = 0.0;
    constexpr double kCosine = 0.99969881869620425;  // of a turn/kAngles
    constexpr double kSine = 0.024541228522912288;
    for (Command& c : turn_) {
      c.phases = {.gates = Gates::kVoltage, .setpoint = {.a = a, .b = b}};
      const double next = kCosine * a - kSine * b;
      b = kSine * a + kCosine * b;
      a = next;
    }
  }

  /// False: a promise is broken.
  bool run(std::uint64_t seconds) {
    const auto per_second = static_cast<Tick>(1'000'000'000 / config_.setup.period_ns);
    const Tick end = static_cast<Tick>(seconds) * per_second;
    const Tick hour = 3600 * per_second;
    const Tick check = std::min(hour, end / 3);  // a short run is checked as well
    std::size_t memory_before = 0;
    bool memory_is_due = false;
    while (bench_.tick() < end && problem_.empty()) {
      const Tick tick = bench_.tick();
      if (tick >= next_event_) something_happens(tick);
      if (tick >= silent_until_) command(tick);
      bench_.step();
      ++steps_;
      account_.see(bench_.sample(0), late_);
      if (bench_.tick() % check == 0) {
        if (!pass_through_bytes()) problem_ = "a saved state can be restored";
        tell(static_cast<double>(bench_.tick()) / static_cast<double>(hour), ::mallinfo2().uordblks);
        memory_is_due = true;
      }
      if (!memory_is_due || !commands_act()) continue;
      memory_is_due = false;
      const std::size_t memory = ::mallinfo2().uordblks;
      if (memory_before != 0 && memory > memory_before + 65536) problem_ = "memory stays flat";
      if (memory_before == 0) memory_before = memory;
    }
    if (problem_.empty() && bench_.tick() != end) problem_ = "every step is counted";
    if (problem_.empty() && steps_ != static_cast<std::uint64_t>(end))
      problem_ = "every step is counted once";
    return problem_.empty();
  }

  const std::string& problem() const { return problem_; }
  void tell(double hours, std::size_t memory) const {
    const Sample& s = bench_.sample(0);
    std::printf(
        "%.4g h: %llu ticks, state hash %016llx, %llu events, %llu missed, %llu refused, %llu late, "
        "%zu bytes in use, %.0f s of CPU\n",
        hours, static_cast<unsigned long long>(steps_), static_cast<unsigned long long>(bench_.state_hash()),
        static_cast<unsigned long long>(events_), static_cast<unsigned long long>(s.missed_commands),
        static_cast<unsigned long long>(s.refused_commands), static_cast<unsigned long long>(s.late_ticks),
        memory, static_cast<double>(std::clock()) / CLOCKS_PER_SEC);
    std::fflush(stdout);
  }

 private:
  /// Only then the account is small: it keeps the commands since the one in force.
  bool commands_act() const {
    return bench_.sample(0).command_tick + 2 >= static_cast<std::int64_t>(bench_.tick());
  }

  AxisAccount make_account() {
    return {config_.setup, 0, true, [this](const std::string& promise) {
              if (problem_.empty()) problem_ = promise;
            }};
  }

  Refused submit(const Action& action, Tick in = 0) {
    account_.scheduled();
    const Tick tick = in == 0 ? 0 : bench_.tick() + in;
    return bench_.submit({.tick = tick, .axis = 0, .owner = owner_, .action = action});
  }

  /// An honest controller: takes the axis, clears latched faults, and turns the voltage.
  void command(Tick tick) {
    if (bench_.owner(0) != owner_) {
      submit(LeaseAction::kAcquire);
      account_.granted(owner_, tick, account_.forces(), [] { return false; });
    }
    if (bench_.is_latched(0) && submit(ClearFaults{}) == Refused::kNot) account_.clear_done(owner_, tick);
    Command c = turn_[static_cast<std::size_t>(tick) % kAngles];
    c.answers = tick;
    account_.command_sent(owner_, tick);
    bench_.submit({.tick = tick, .axis = 0, .owner = owner_, .action = c});
  }

  void submit_zero_voltage(Tick answers) {
    account_.command_sent(owner_, answers);
    submit(Command{.answers = answers, .phases = {.gates = Gates::kZeroVoltage}});
  }

  void something_happens(Tick tick) {
    ++events_;
    next_event_ = tick + random_.between(1, 4000);
    switch (random_.below(10)) {
      case 0:
        silent_until_ = tick + random_.between(1, 60);  // the watchdog is at 20
        return;
      case 1:
        account_.may_go(owner_);
        submit(random_.chance(0.5) ? LeaseAction::kLost : LeaseAction::kRelease);
        return;
      case 2:
        submit(LoadChange{.load_nm = random_.real(-0.3, 0.3), .ramp_ticks = random_.between(0, 2000)},
               random_.between(0, 3000));
        return;
      case 3:
      case 4: {
        const auto row = static_cast<std::uint32_t>(random_.below(kInjectableFaultCount));
        const InjectableFault& fault = kInjectableFaults[row];
        const double bad = fault.integer ? 1.0 : random_.real(0.0, fault.maximum) * 0.1;
        submit(InjectFault{.row = row, .value = bad});
        submit(InjectFault{.row = row, .value = 0.0}, random_.between(1, 4000));
        return;
      }
      case 5: {
        const auto rows = axis_parameters(config_.setup.axes[0].parameters);
        const std::size_t row = random_.below(rows.size());
        if (!rows[row].live) return;
        const double usual = rows[row].get(config_.setup.axes[0].parameters);
        submit(ParameterWrite{.row = static_cast<std::uint32_t>(row),
                              .value = rows[row].integer ? usual : usual * random_.real(0.8, 1.25),
                              .ramp_ticks = random_.between(0, 500)});
        return;
      }
      case 6:
        ++late_;
        submit(random_.chance(0.1) ? Action(Overrun{}) : Action(LateTick{}));
        return;
      case 7:
        submit(ShaftBump{.impulse_nms = random_.real(-1e-4, 1e-4)});
        return;
      case 8:
        return submit_zero_voltage(tick + random_.between(-5, 5));
      default:
        account_.forget(owner_++);
        silent_until_ = tick + random_.between(0, 30'000);  // beyond the lease
        return;
    }
  }

  bool pass_through_bytes() {
    const std::vector<std::byte> saved = bench_.save();
    const std::uint64_t hash = bench_.state_hash();
    Bench other(config_.setup);
    if (!other.restore(saved) || other.state_hash() != hash) return false;
    return bench_.restore(other.save()) && bench_.state_hash() == hash;
  }

  BenchConfig config_;
  Random random_;
  std::string problem_;
  AxisAccount account_;
  Bench bench_;
  std::array<Command, kAngles> turn_{};
  Owner owner_ = 1;
  Tick next_event_ = 0;
  Tick silent_until_ = 0;
  std::uint64_t late_ = 0;
  std::uint64_t steps_ = 0;
  std::uint64_t events_ = 0;
};

}  // namespace

int run_long(std::uint64_t seconds, std::uint64_t seed) {
  const BenchConfig config = load_config(DRIVEBENCH_CONFIGS "/benches/servo.toml");
  Week week(config, seed);
  if (!week.run(seconds)) {
    std::printf("broken: %s\n", week.problem().c_str());
    return 1;
  }
  week.tell(static_cast<double>(seconds) / 3600.0, ::mallinfo2().uordblks);
  return 0;
}

}  // namespace drivebench::simulator
