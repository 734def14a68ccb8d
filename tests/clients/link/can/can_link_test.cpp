// The controller's side of the CAN profile against a bench in memory that answers as the profile says, and
// loses or spoils what a test wants.
#include "clients/link/can/can_link.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/clients/link/can/fake_can_bench.hpp"

namespace drivebench::link::can_link_test {
namespace {

using namespace std::chrono_literals;
using can::Message;

constexpr CanLinkOptions kImpatient = {.deadline = 30ms, .repeat_after = 1ms};

bool is(const can::Frame& frame, can::Profile profile, Message message) {
  profile.wide = true;
  const can::Match match = can::match(profile, frame);
  return match.ok() && match.row->message == message;
}

struct Kind {
  bool fd;
  bool wide;
};

/// The part of a command that a narrow axis has too.
std::vector<double> narrow(std::vector<double> command) {
  command.resize(std::min<std::size_t>(command.size(), 4));
  return command;
}

class CanLinkOf : public testing::TestWithParam<Kind> {
 protected:
  CanLinkOf() {
    address_.node = kNode;
    address_.profile.fd = GetParam().fd;
    can::Profile profile = address_.profile;
    profile.wide = GetParam().wide;  // the link learns this by itself
    auto bus = std::make_unique<FakeCanBench>(profile, kNode);
    bench_ = bus.get();
    bus_ = std::move(bus);
  }
  /// Connected, with the lease.
  CanLink& link() {
    if (!link_) {
      link_.emplace(std::move(bus_), address_, "can:test", kImpatient);
      link_->acquire();
    }
    return *link_;
  }
  /// Loses the first `count` frames of this kind.
  void lose(Message message, int count) {
    bench_->loses = [this, message, count](const can::Frame& frame) mutable {
      return is(frame, address_.profile, message) && count-- > 0;
    };
  }
  std::string failure_of(const std::function<void()>& action) {
    try {
      action();
    } catch (const LinkError& error) {
      return error.what();
    }
    return "no failure";
  }

  CanAddress address_;
  FakeCanBench* bench_ = nullptr;
  std::unique_ptr<CanBus> bus_;
  std::optional<CanLink> link_;
};
INSTANTIATE_TEST_SUITE_P(Profiles, CanLinkOf,
                         testing::Values(Kind{false, false}, Kind{true, false}, Kind{false, true},
                                         Kind{true, true}),
                         [](const auto& kind) {
                           return std::string(kind.param.wide ? "Wide" : "") +
                                  (kind.param.fd ? "Fd" : "Classic");
                         });

class ClassicCanLink : public CanLinkOf {};
INSTANTIATE_TEST_SUITE_P(Profile, ClassicCanLink, testing::Values(Kind{false, false}));
class WideCanLink : public CanLinkOf {};
INSTANTIATE_TEST_SUITE_P(Profiles, WideCanLink, testing::Values(Kind{false, true}, Kind{true, true}),
                         [](const auto& kind) { return kind.param.fd ? "Fd" : "Classic"; });
class WideClassicCanLink : public CanLinkOf {};
INSTANTIATE_TEST_SUITE_P(Profile, WideClassicCanLink, testing::Values(Kind{false, true}));

// Catches: a mode, period or first sample that is made up rather than received, and the truth that CAN does
// not carry passed off as known.
TEST_P(CanLinkOf, TakesModePeriodAndSampleFromTheFrames) {
  bench_->sample.tick = 5;
  bench_->sample.encoder_count = -40;
  bench_->sample.i_a_a = 1.5;
  bench_->sample.state = 2;
  EXPECT_EQ(link().bench().mode(), v1::MODE_LOCKSTEP);
  EXPECT_DOUBLE_EQ(link().bench().period_s(), 125e-6);
  const Sample& sample = link().newest();
  EXPECT_EQ(sample.tick, 5U);
  EXPECT_EQ(sample.encoder_count, -40);
  EXPECT_DOUBLE_EQ(sample.i_a_a, 1.5);
  EXPECT_EQ(sample.state, 2U);
  EXPECT_TRUE(link().knows("encoder_count"));
  EXPECT_TRUE(link().knows("faults"));
  for (const char* name : {"angle_rad", "speed_rad_s", "load_nm", "true_i_c_a", "no_signal"}) {
    EXPECT_FALSE(link().knows(name)) << name;
  }
  for (const char* name : {"u_a_v", "i_c_a", "hall_lines", "injected"}) {
    EXPECT_EQ(link().knows(name), GetParam().wide) << name;
  }
}

// Catches: a field of a command in the wrong place, unit or not at all.
TEST_P(CanLinkOf, SendsEveryFieldOfACommand) {
  link().exchange({.tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 12.5, .u_b_v = -3.25});
  EXPECT_EQ(narrow(bench_->command), (std::vector<double>{0.0, 12.5, -3.25, 1.0}));
  link().exchange({.tick = 1, .gates = v1::GATES_OFF});
  EXPECT_EQ(narrow(bench_->command), (std::vector<double>{1.0, 0.0, 0.0, 0.0}));
  link().exchange({.tick = 2, .gates = v1::GATES_CURRENT, .u_a_v = 9.0, .i_a_a = 1.25, .i_b_a = -2.5});
  EXPECT_EQ(narrow(bench_->command), (std::vector<double>{2.0, 1.25, -2.5, 4.0}));
  link().exchange({.tick = 3, .gates = v1::GATES_DUTY, .u_a_v = 9.0, .d_a = 1.0, .d_b = -1.0, .legs_off = 2});
  EXPECT_EQ(narrow(bench_->command), (std::vector<double>{3.0, 1.0, -1.0, 5.0}));
  EXPECT_EQ(bench_->legs_off, 2.0);
}

// Catches: set-points of phase c or of the field that are left out, are those of another kind, or go to an
// axis that has neither.
TEST_P(CanLinkOf, SendsPhaseCAndTheFieldOfAWideAxis) {
  const AxisCommand command = {
      .tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_c_v = -2.5, .u_f_v = 24.0};
  if (!GetParam().wide) {
    EXPECT_THROW(link().exchange(command), RefusalError);
    return;
  }
  link().exchange(command);
  EXPECT_EQ(bench_->command, (std::vector<double>{0.0, 1.0, 0.0, 1.0, -2.5, 24.0}));
  link().exchange({.tick = 1, .gates = v1::GATES_CURRENT, .u_c_v = 9.0, .i_c_a = 0.5, .i_f_a = -1.5});
  EXPECT_EQ(bench_->command, (std::vector<double>{1.0, 0.0, 0.0, 4.0, 0.5, -1.5}));
}

// Catches: a signal of a wide axis that its frames carry and that the link drops.
TEST_P(WideCanLink, TakesEverySignalOfTheFrames) {
  bench_->sample.i_c_a = -1.5;
  bench_->sample.i_f_a = 2.5;
  bench_->sample.hall_lines = 6;
  bench_->sample.tachometer_v = 7.5;
  bench_->sample.resolver_cos_v = -0.25;
  bench_->sample.u_b_v = 12.5;
  bench_->sample.injected = 0x1234567;
  const Sample& sample = link().newest();
  EXPECT_EQ(sample.i_c_a, -1.5);
  EXPECT_EQ(sample.i_f_a, 2.5);
  EXPECT_EQ(sample.hall_lines, 6U);
  EXPECT_EQ(sample.tachometer_v, 7.5);
  EXPECT_EQ(sample.resolver_cos_v, -0.25);
  EXPECT_EQ(sample.u_b_v, 12.5);
  EXPECT_EQ(sample.injected, 0x1234567U);
}

// Catches: currents of phase c, or the voltage of the tachometer, of one tick taken together with the others
// of another.
TEST_P(WideClassicCanLink, ASampleNeedsItsPhasesFrame) {
  link();
  bench_->sample.tick = 9;
  bench_->sample.tachometer_v = 3.5;
  bench_->put(Message::kEncoder);
  bench_->put(Message::kDetails, can::Page::kSpeedSensors);
  EXPECT_EQ(link().newest().tachometer_v, 0.0) << "of the sample that is coming";
  bench_->put(Message::kCurrents);
  EXPECT_EQ(link().newest().tick, 0U);
  bench_->put(Message::kEncoder);
  bench_->put(Message::kPhases);
  bench_->put(Message::kCurrents);
  EXPECT_EQ(link().newest().tick, 9U);
  EXPECT_EQ(link().newest().tachometer_v, 3.5);
}

// Catches: a tick or count that falls back when its low bits start again.
TEST_P(CanLinkOf, CarriesTicksAndCountsOverTheEndOfTheirBits) {
  const std::uint64_t first = address_.profile.fd ? 0xFFFFFFFEU : 0xF003FFFEU;
  bench_->sample.tick = first;
  bench_->sample.encoder_count = std::numeric_limits<std::int32_t>::max() - 2;
  std::uint64_t tick = link().newest().tick;
  EXPECT_EQ(tick, first);
  for (int i = 0; i < 5; ++i)
    tick = link().exchange({.tick = tick, .gates = v1::GATES_ZERO}).tick;
  EXPECT_EQ(tick, first + 5);
  EXPECT_EQ(link().newest().encoder_count, std::int64_t{std::numeric_limits<std::int32_t>::max()} + 3);
}

// Catches: a lockstep that stands still, or runs a tick twice, after a frame was lost on either way.
TEST_P(CanLinkOf, LockstepSurvivesLostFrames) {
  std::uint64_t tick = link().newest().tick;
  for (const Message lost :
       {Message::kCommand, Message::kPhaseCommand, Message::kSensors, Message::kEncoder, Message::kPhases,
        Message::kCurrents, Message::kSync, Message::kReply, Message::kState}) {
    lose(lost, 2);
    const Sample& sample =
        link().exchange({.tick = tick, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_b_v = 0.0});
    EXPECT_EQ(sample.tick, tick + 1);
    EXPECT_EQ(sample.encoder_count, static_cast<std::int64_t>(tick + 1));
    EXPECT_EQ(sample.i_c_a, GetParam().wide ? static_cast<double>(tick + 1) : 0.0) << "of the same tick";
    tick = sample.tick;
  }
  EXPECT_EQ(bench_->sample.tick, tick);
}

// Catches: an acquire or release that hangs or fails because a frame was lost.
TEST_P(CanLinkOf, RequestsSurviveLostFrames) {
  lose(Message::kRequest, 3);
  link();
  lose(Message::kReply, 1);
  EXPECT_NO_THROW(link().release());
  EXPECT_EQ(bench_->lease, 0.0);
}

// Catches: an axis that stays taken by a controller that is gone.
TEST_P(CanLinkOf, GivesTheAxisBackAtItsEnd) {
  link();
  const can::Profile profile = address_.profile;
  bool released = false;
  bench_->loses = [&released, profile](const can::Frame& frame) {
    const bool asks = is(frame, profile, Message::kRequest);
    released |= asks && frame.data[0] == 3 && frame.data[1] == 7;
    return false;
  };
  link_.reset();
  EXPECT_TRUE(released);
}

// Catches: a count of one tick taken together with the currents of another.
TEST_P(ClassicCanLink, CurrentsWithoutTheirEncoderFrameAreNoSample) {
  link();
  bench_->sample.tick = 9;
  bench_->put(Message::kCurrents);
  EXPECT_EQ(link().newest().tick, 0U);
  bench_->put(Message::kEncoder);
  EXPECT_EQ(link().newest().tick, 0U);
  bench_->put(Message::kCurrents);
  EXPECT_EQ(link().newest().tick, 9U);
}

// Catches: a refusal that is taken for another, or for a dead link.
TEST_P(CanLinkOf, RefusalsHaveTheirCodes) {
  const std::vector<std::pair<double, v1::RefusalCode>> codes = {
      {2.0, v1::REFUSAL_OWNED},     {3.0, v1::REFUSAL_NOT_FINITE}, {4.0, v1::REFUSAL_LATCHED},
      {6.0, v1::REFUSAL_BUSY},      {7.0, v1::REFUSAL_MALFORMED},  {9.0, v1::REFUSAL_WRONG_DRIVE},
      {99.0, v1::REFUSAL_MALFORMED}};
  link();
  for (const auto& [result, code] : codes) {
    bench_->command_result = bench_->request_result = result;
    for (const bool asks : {false, true}) {
      try {
        if (asks) {
          link().clear_faults();
        } else {
          link().exchange({.tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_b_v = 1.0});
        }
        ADD_FAILURE() << result << " was no refusal";
      } catch (const RefusalError& refused) {
        EXPECT_EQ(refused.code(), code) << result;
      }
    }
  }
}

// Catches: a lease that is lost without a word.
TEST_P(CanLinkOf, ALostLeaseIsARefusal) {
  link();
  bench_->lease = 8;
  try {
    link().exchange({.tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_b_v = 1.0});
    ADD_FAILURE();
  } catch (const RefusalError& refused) {
    EXPECT_EQ(refused.code(), v1::REFUSAL_NOT_OWNER);
  }
}

// Catches: a controller that gives up because the bench refused another controller on the bus.
TEST_P(CanLinkOf, IgnoresRefusalsOfOtherControllers) {
  link();
  bench_->put_reply(0.0, 1.0, 0.0, 7.0, 0.0);   // another controller commanded without the lease
  bench_->put_reply(1.0, 2.0, 77.0, 0.0, 0.0);  // or asked for it
  bench_->put_reply(2.0, 1.0, 77.0, 0.0, 0.0);
  bench_->put_reply(0.0, 4.0, 0.0, 7.0, 200.0);  // and this is about a tick long gone
  EXPECT_EQ(link().exchange({.tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_b_v = 1.0}).tick, 1U);
}

// Catches: frames of another node, of no node or about the bus that pass for the bench's.
TEST_P(CanLinkOf, IgnoresFramesOfOtherNodes) {
  link();
  can::Profile profile = address_.profile;
  FakeCanBench other(profile, kNode + 1);
  other.sample.tick = 50;
  other.put_sample();
  for (can::Frame frame : other.coming) {
    if (!is(frame, profile, Message::kSync)) bench_->add(frame);
  }
  bench_->sample.tick = 60;
  bench_->put(Message::kSensors);
  bench_->put(Message::kEncoder);
  bench_->put(Message::kCurrents);
  for (can::Frame& frame : bench_->coming) {
    if (!is(frame, profile, Message::kHeartbeat) && can::match(profile, frame).node == kNode)
      frame.error = true;
  }
  EXPECT_EQ(link().newest().tick, 0U);
}

// Catches: a link that waits for ever, or does not say for what.
TEST_P(CanLinkOf, SilenceIsAnErrorThatNamesTheMissingFrame) {
  link();
  bench_->loses = [](const can::Frame&) { return true; };
  const std::string what = failure_of([this] { link().exchange({.tick = 0, .gates = v1::GATES_VOLTAGE}); });
  EXPECT_NE(what.find("can:test sent no sample after tick 0 of node 3 within 30 ms"), std::string::npos)
      << what;
  bench_->coming.clear();
  const auto connect = [this] {
    CanLink(std::make_unique<FakeCanBench>(address_.profile, kNode + 1), address_, "can:other", kImpatient);
  };
  EXPECT_THROW(connect(), ConnectError);
  EXPECT_NE(failure_of(connect).find("heartbeat"), std::string::npos);
}

// Catches: a link that waits without a word for frames that come in another form.
TEST_P(CanLinkOf, FramesOfTheOtherProfileAreNamed) {
  can::Profile other = address_.profile;
  other.fd = !other.fd;
  FakeCanBench peer(other, kNode);
  peer.put_state();
  peer.put_sample();
  bench_->coming = peer.coming;
  bench_->loses = [](const can::Frame&) { return true; };
  const std::string what = failure_of([this] { link(); });
  EXPECT_NE(what.find("do both ends agree on fd"), std::string::npos) << what;
}

// Catches: frames that are read by another version's table.
TEST_P(CanLinkOf, RefusesAnotherVersionOfTheTable) {
  bench_->coming.clear();
  bench_->version = 5;
  bench_->heartbeat();
  EXPECT_NE(failure_of([this] {
              link();
            }).find("speaks version 5 of the profile, this program here versions 3 and 4"),
            std::string::npos);
}

// Catches: a bench that ends and is waited for.
TEST_P(CanLinkOf, ABenchThatStopsEndsTheLink) {
  link();
  bench_->put(Message::kHeartbeat, {4.0, bench_->version, 0.0, 0.0, 125.0});
  EXPECT_NE(failure_of([this] { link().newest(); }).find("stopped"), std::string::npos);
}

// Catches: real time taken for lockstep, and a controller that works through old samples.
TEST_P(CanLinkOf, RealTimeGoesOnWithTheNewestSample) {
  bench_->lockstep = bench_->sends_sync = false;
  for (bench_->sample.tick = 100; bench_->sample.tick < 103; ++bench_->sample.tick)
    bench_->put_sample();
  EXPECT_EQ(link().bench().mode(), v1::MODE_REALTIME);
  bench_->sample.tick = 110;
  bench_->put_sample();
  EXPECT_EQ(link().newest().tick, 110U);
  for (bench_->sample.tick = 111; bench_->sample.tick < 115; ++bench_->sample.tick)
    bench_->put_sample();
  lose(Message::kCommand, 1);
  EXPECT_EQ(link().exchange({.tick = 110, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_b_v = 1.0}).tick,
            114U);
}

// Catches: a request that CAN has no frame for and that does nothing.
TEST_P(CanLinkOf, RefusesRequestsWithoutAFrame) {
  EXPECT_FALSE(link().can_set_load());
  EXPECT_THROW(link().set_load({.load_nm = 1.0}), RefusalError);
  EXPECT_THROW(link().write_parameter("machine.pole_pairs", 3.0), RefusalError);
}

}  // namespace
}  // namespace drivebench::link::can_link_test
