// One rule for commands in every mode: what the engine answers is what the bench does.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "server/bench/bench.hpp"
#include "server/engine/axis_mail.hpp"
#include "server/engine/engine.hpp"
#include "server/engine/stepped_engine.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::judge_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kLimitV = 40.0;

/// Something that happens to a bench, and for a command the verdict that is due.
struct Step {
  enum class What { kSend, kTurn, kLatch, kClear, kRetake };
  What what = What::kTurn;
  Gates gates = Gates::kVoltage;
  double volts = 0.0;
  Tick back = 0;  ///< turns before the newest sample, of the sample that the command answers
  Owner sender = kMe;
  Refused due = Refused::kNot;
};

Step volts(double wanted, Refused due = Refused::kNot, Tick back = 0) {
  return {.what = Step::What::kSend, .volts = wanted, .back = back, .due = due};
}
Step gates(Gates wanted, Refused due = Refused::kNot, Tick back = 0) {
  return {.what = Step::What::kSend, .gates = wanted, .back = back, .due = due};
}
Step volts_of(Owner sender, Refused due) {
  return {.what = Step::What::kSend, .sender = sender, .due = due};
}
const Step kTurn{.what = Step::What::kTurn};
const Step kLatch{.what = Step::What::kLatch};
const Step kClear{.what = Step::What::kClear};
const Step kRetake{.what = Step::What::kRetake};

/// One axis, owned by kMe, whose set-points may move by 1 V in a turn: a tick, or in a free run as many ticks
/// as pass before the I/O thread is told.
class JudgedBench {
 public:
  explicit JudgedBench(RunMode mode) : turn_ticks_(mode == RunMode::kFree ? 1024 : 1) {
    BenchConfig config = servo_bench();
    config.mode = mode;
    config.setup.watchdog_ticks = 1'000'000;
    config.setup.lease_ticks = 1'000'000;
    AxisSetup& axis = config.setup.axes[0];
    axis.parameters.drive.amplifier.voltage_limit_v = kLimitV;
    const double turn_s = static_cast<double>(turn_ticks_ * config.setup.period_ns) * 1e-9;
    axis.rules = {.on_excess = OnExcess::kRefuse, .slew_per_s = 1.0 / turn_s};
    if (mode == RunMode::kLockstep) {
      lockstep_ = make_lockstep_engine(config);
    } else {
      stepped_ = make_stepped_engine(config, nullptr, io_, make_free_pacer());
    }
    request(LeaseAction::kAcquire);
  }
  ~JudgedBench() { engine().stop(); }

  Engine& engine() { return lockstep_ ? *lockstep_ : *stepped_.engine; }

  /// The verdict on a command, as check() and command() agree on it.
  Refused send(const Step& step) {
    const Command command{.answers = engine().tick() - step.back * turn_ticks_,
                          .phases = {.gates = step.gates, .setpoint = {.a = step.volts}}};
    const Refused checked = engine().check(0, step.sender, command);
    const Refused answered = engine().command(0, step.sender, command);
    EXPECT_EQ(checked, answered);
    has_command_ = has_command_ || answered == Refused::kNot;
    if (answered != Refused::kNot && !lacks_lease(answered)) ++refused_;
    return answered;
  }
  Refused play(const Step& step) {
    if (step.what == Step::What::kSend) return send(step);
    if (step.what == Step::What::kTurn) turn();
    if (step.what == Step::What::kLatch) request(Overrun{});
    if (step.what == Step::What::kClear) request(ClearFaults{});
    if (step.what == Step::What::kRetake) {
      request(LeaseAction::kRelease);
      request(LeaseAction::kAcquire);
    }
    return Refused::kNot;
  }
  void turn() {
    if (lockstep_) {
      if (!has_command_) send(gates(Gates::kOff));
      engine().advance();
    } else {
      run_ticks();
    }
    has_command_ = false;
  }
  /// Commands that were answered as refused, and not for want of the lease.
  std::uint64_t refused() const { return refused_; }

 private:
  void request(const Action& action) {
    engine().request({.tick = 0, .axis = 0, .owner = kMe, .action = action}, [](Refused, Tick) {});
    if (!lockstep_) run_ticks();
  }
  void run_ticks() {
    for (Tick i = 0; i < turn_ticks_; ++i)
      stepped_.tick();
    io_.restart();
    io_.poll();
  }

  Tick turn_ticks_;
  asio::io_context io_{1};
  std::unique_ptr<Engine> lockstep_;
  SteppedEngine stepped_;
  bool has_command_ = false;
  std::uint64_t refused_ = 0;
};

struct Case {
  std::string_view name;
  std::vector<Step> steps;
};

const std::vector<Case>& cases() {
  using enum Refused;
  static const std::vector<Case> all = {
      {"a ramp within the slope", {volts(0), kTurn, volts(0.9), kTurn, volts(1.8), kTurn, volts(0.9)}},
      {"a first command is too steep", {volts(1.5, kBeyondDrive)}},
      {"a command is too steep", {volts(0), kTurn, volts(0.9), kTurn, volts(2.0, kBeyondDrive), volts(1.8)}},
      {"what was refused is no start for the next",
       {volts(0), kTurn, volts(5, kBeyondDrive), volts(4.5, kBeyondDrive), volts(0.9)}},
      {"other gates start at zero",
       {volts(0), kTurn, volts(0.9), kTurn, gates(Gates::kOff), kTurn, volts(0.9)}},
      {"a new lease starts at zero",
       {volts(0), kTurn, volts(0.9), kTurn, volts(1.8), kTurn, kRetake, volts(1.8, kBeyondDrive), volts(0)}},
      {"beyond the amplifier", {volts(0), kTurn, volts(std::nextafter(kLimitV, 50.0), kBeyondDrive)}},
      {"no number", {volts(kNan, kNotFinite), volts(1e308, kBeyondDrive)}},
      {"currents for a voltage amplifier", {gates(Gates::kCurrent, kWrongDrive)}},
      {"answered already", {volts(0), volts(0, kStale), kTurn, volts(0, kStale, 1), volts(0)}},
      {"not taken yet", {volts(0, kStale, -1), volts(0)}},
      {"before the first sample", {volts(0, kStale, 2)}},
      {"without the lease", {volts_of(kStranger, kNotOwner), volts_of(0, kNotOwner), volts(0)}},
      {"latched", {volts(0), kTurn, kLatch, volts(0, kLatched), gates(Gates::kOff)}},
      {"values come before the latch", {kLatch, volts(kNan, kNotFinite), gates(Gates::kOff)}},
  };
  return all;
}

class Judge : public testing::TestWithParam<RunMode> {};

INSTANTIATE_TEST_SUITE_P(EveryMode, Judge,
                         testing::Values(RunMode::kLockstep, RunMode::kRealtime, RunMode::kFree),
                         [](const auto& mode) { return std::string(name_of(mode.param)); });

// Catches: a rule that one mode has and another lacks; a command that is answered as taken and that the bench
// refuses, so that only a counter tells of it.
TEST_P(Judge, CMD_13_TheAnswerToACommandIsWhatTheBenchDoes) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    JudgedBench bench(GetParam());
    for (std::size_t i = 0; i < c.steps.size(); ++i)
      EXPECT_EQ(bench.play(c.steps[i]), c.steps[i].due) << "step " << i;
    bench.turn();
    EXPECT_EQ(bench.engine().newest(0).refused_commands, bench.refused());
  }
}

// The bench takes the newest command before a tick, so that it may never see the one before that. Catches: a
// command judged only by one that the bench does not get.
TEST(JudgeRealtime, ANewerCommandMustBeValidWithoutTheOneItReplaces) {
  JudgedBench bench(RunMode::kRealtime);
  const std::vector<Step> ramp = {volts(0), kTurn, volts(0.9), kTurn, volts(1.8), kTurn, kTurn};
  for (const Step& step : ramp)
    ASSERT_EQ(bench.play(step), Refused::kNot);
  EXPECT_EQ(bench.send(gates(Gates::kOff, Refused::kNot, 1)), Refused::kNot);
  EXPECT_EQ(bench.send(volts(-0.9)), Refused::kBeyondDrive) << "2.7 V in two ticks from what the bench has";
  bench.turn();
  EXPECT_EQ(bench.send(volts(-0.9)), Refused::kNot) << "the gates were off";
  bench.turn();
  EXPECT_EQ(bench.engine().newest(0).refused_commands, 1u);
}

// Catches: a command that the bench refused, kept as the one that the next is judged by.
TEST(JudgeRealtime, ACommandThatTheBenchRefusedIsForgotten) {
  JudgedBench bench(RunMode::kRealtime);
  ASSERT_EQ(bench.send(volts(0)), Refused::kNot);
  bench.turn();
  ASSERT_EQ(bench.send(volts(0.9)), Refused::kNot);
  bench.play(kLatch);  // the bench latches before it looks at the command, and refuses it
  EXPECT_EQ(bench.engine().newest(0).refused_commands, 1u);
  bench.play(kClear);
  EXPECT_EQ(bench.send(volts(-2.5)), Refused::kNot) << "three ticks after 0 V";
  bench.turn();
  EXPECT_EQ(bench.engine().newest(0).refused_commands, 1u);
}

// Catches: a session whose axis is taken by force gets "not the owner" before it learns who took the axis.
TEST(CommandMail, AnOwnerStaysOwnerUntilTheSampleShowsTheEndOfItsLease) {
  constexpr Owner kOther = kMe + 1;
  Bench bench(servo_bench().setup);
  CommandMail mail;
  const auto lease = [&](LeaseAction action, Owner owner) {
    bench.submit({.tick = bench.tick(), .axis = 0, .owner = owner, .action = action});
  };
  lease(LeaseAction::kAcquire, kMe);
  mail.deliver(bench, 0);
  bench.step();
  const CommandView shown = bench.command_view(0);  // as the newest sample shows it
  const Command command{.answers = bench.tick(), .phases = {.gates = Gates::kOff}};
  EXPECT_EQ(mail.judge(command, kMe, shown), Refused::kNot);

  lease(LeaseAction::kLost, kMe);
  lease(LeaseAction::kAcquire, kOther);
  mail.deliver(bench, 0);
  EXPECT_EQ(mail.judge(command, kMe, shown), Refused::kNot);
  EXPECT_EQ(mail.judge(command, kOther, shown), Refused::kNotOwner);

  bench.step();
  const Command next{.answers = bench.tick(), .phases = {.gates = Gates::kOff}};
  EXPECT_EQ(mail.judge(next, kMe, bench.command_view(0)), Refused::kNotOwner);
  EXPECT_EQ(mail.judge(next, kOther, bench.command_view(0)), Refused::kNot);
}

}  // namespace
}  // namespace drivebench::judge_test
