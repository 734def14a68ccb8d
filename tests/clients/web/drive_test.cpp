#include "clients/web/gateway/drive/drive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "protocols/framing.hpp"

namespace drivebench::web::drive_test {
namespace {

using namespace std::chrono_literals;

constexpr char kOneVolt[] =
    R"({"op":"drive","axes":[{"axis":0,"gates":"voltage","constant":[1,0,0,0],"boost":0,"per_hz":0,)"
    R"("frequency_hz":0,"ramp_s":0}]})";
constexpr char kSlowTwoVolts[] =
    R"({"op":"drive","axes":[{"axis":0,"gates":"voltage","constant":[2,0,0,0],"boost":0,"per_hz":0,)"
    R"("frequency_hz":0,"ramp_s":100}]})";

v1::Welcome welcome_of(v1::Mode mode) {
  v1::Welcome welcome;
  welcome.mutable_bench()->set_mode(mode);
  welcome.mutable_bench()->set_period_s(1e-3);
  v1::AxisDescription& axis = *welcome.mutable_bench()->add_axes();
  axis.set_phases(3);
  axis.set_connection("star");
  return welcome;
}

/// A drive and a bench that answers it.
class DriveTest : public testing::Test {
 protected:
  /// The requests that the drive makes until it wants to wait.
  std::vector<v1::Envelope> asked() {
    std::vector<v1::Envelope> requests;
    for (Drive::Turn turn = drive_.next(now_); !turn.bytes.empty(); turn = drive_.next(now_)) {
      FrameReader reader(kMaxRequestFrame);
      const std::span<std::byte> space = reader.free_space();
      std::ranges::copy(std::as_bytes(std::span(turn.bytes)), space.begin());
      reader.received(turn.bytes.size());
      while (const auto payload = reader.next()) {
        requests.emplace_back().ParseFromArray(payload->data(), static_cast<int>(payload->size()));
      }
    }
    return requests;
  }

  bool answer(const v1::Envelope& envelope) {
    const std::string bytes = envelope.SerializeAsString();
    return drive_.take(std::as_bytes(std::span(bytes)), now_);
  }

  void answer_with_tick(const v1::Envelope& request, std::uint64_t tick) {
    v1::Envelope reply;
    reply.set_id(request.id());
    v1::Sample& sample = *reply.mutable_exchange_reply()->add_samples()->mutable_sample();
    sample.set_tick(tick);
    sample.set_state(1);  // run
    EXPECT_TRUE(answer(reply));
  }

  void refuse(const v1::Envelope& request, v1::RefusalCode code, const std::string& sentence) {
    v1::Envelope reply;
    reply.set_id(request.id());
    reply.mutable_refusal()->set_code(code);
    reply.mutable_refusal()->set_message(sentence);
    EXPECT_TRUE(answer(reply));
  }

  /// The command of the only request.
  v1::Command command_at(std::uint64_t tick) {
    const std::vector<v1::Envelope> requests = asked();
    EXPECT_EQ(requests.size(), 1u);
    if (requests.empty()) return {};
    answer_with_tick(requests[0], tick);
    return requests[0].exchange().commands_size() == 1 ? requests[0].exchange().commands(0) : v1::Command();
  }

  void order(const std::string& text) {
    const Order read = drive_.read(text);
    drive_.carry_out(read, made_runs(drive_.bench(), drive_.beginnings_of(read)), now_);
  }

  /// Drives from tick 5 on.
  void begin(const std::string& text) {
    order(text);
    const std::vector<v1::Envelope> requests = asked();
    ASSERT_EQ(requests.size(), 1u);
    EXPECT_TRUE(requests[0].exchange().commands().empty());
    answer_with_tick(requests[0], 5);
  }

  Drive::Time now_{1000s};
  Drive drive_{welcome_of(v1::MODE_REALTIME)};
};

// Catches: a command for a tick that the bench has not told, two requests at a time, an answer of the page
// that the drive swallows.
TEST_F(DriveTest, EachAnswerHasItsCommand) {
  begin(kOneVolt);
  const v1::Command first = command_at(6);
  EXPECT_EQ(first.tick(), 5u);
  EXPECT_EQ(first.gates(), v1::GATES_VOLTAGE);
  EXPECT_EQ(first.u_a_v(), 1.0);
  const std::vector<v1::Envelope> second = asked();
  ASSERT_EQ(second.size(), 1u);
  EXPECT_EQ(second[0].exchange().commands(0).tick(), 6u);
  EXPECT_TRUE(asked().empty());
  v1::Envelope of_page;
  of_page.set_id(7);
  of_page.mutable_done();
  EXPECT_FALSE(answer(of_page));
}

// Catches: a page that has gone and a drive that goes on, gates that stay on while the lease goes back, a
// ramp as long as the operator's own.
TEST_F(DriveTest, ASilentPageIsRampedDownAndGivesTheLeaseBack) {
  begin(kOneVolt);
  order(kSlowTwoVolts);
  command_at(6);
  now_ += Drive::kSilence - 1ms;
  EXPECT_EQ(command_at(7).gates(), v1::GATES_VOLTAGE);
  now_ += 1ms;
  EXPECT_EQ(command_at(507).gates(), v1::GATES_VOLTAGE);
  EXPECT_NEAR(command_at(1100).u_a_v(), 0.5, 0.01);  // half of the ramp of a second
  command_at(1101);
  const v1::Command off = command_at(1102);
  EXPECT_EQ(off.gates(), v1::GATES_OFF);
  const std::vector<v1::Envelope> last = asked();
  ASSERT_EQ(last.size(), 1u);
  EXPECT_EQ(last[0].lease().action(), v1::LeaseRequest::ACTION_RELEASE);
  EXPECT_TRUE(drive_.is_over());
  EXPECT_NE(drive_.report(now_).find("silent"), std::string::npos);
}

// Catches: a page that is heard and yet given up.
TEST_F(DriveTest, APageThatIsHeardDrivesOn) {
  begin(kOneVolt);
  for (std::uint64_t tick = 6; tick < 20; ++tick) {
    now_ += 1s;
    order(R"({"op":"alive"})");
    EXPECT_EQ(command_at(tick).gates(), v1::GATES_VOLTAGE);
  }
}

// Catches: set-points that come back after a refusal, a drive that repeats what is refused for ever, a
// sentence that is not the bench's.
TEST_F(DriveTest, ARefusalSwitchesOffAndASecondOneEnds) {
  begin(kOneVolt);
  refuse(asked().at(0), v1::REFUSAL_LATCHED, "a fault is latched");
  EXPECT_NE(drive_.report(now_).find("a fault is latched"), std::string::npos);
  EXPECT_EQ(command_at(8).gates(), v1::GATES_OFF);  // asks for the tick anew
  const std::vector<v1::Envelope> off = asked();
  EXPECT_EQ(off.at(0).exchange().commands(0).gates(), v1::GATES_OFF);
  EXPECT_EQ(off.at(0).exchange().commands(0).tick(), 8u);
  refuse(off[0], v1::REFUSAL_STALE, "the command is stale");
  EXPECT_EQ(asked().at(0).lease().action(), v1::LeaseRequest::ACTION_RELEASE);
  EXPECT_TRUE(drive_.is_over());
}

// Catches: the end of a drive whose last command the bench never answers, such as in lockstep beside a
// controller that has stopped.
TEST_F(DriveTest, AnAnswerThatNeverComesDoesNotKeepTheLease) {
  begin(kOneVolt);
  EXPECT_EQ(asked().size(), 1u);
  order(R"({"op":"drive","axes":[]})");
  EXPECT_TRUE(asked().empty());
  now_ += 1s;
  EXPECT_TRUE(asked().at(0).has_lease());
}

// Catches: lockstep that runs as fast as it can, that does not stand still, a step of another number of
// ticks, a pause that is caught up.
TEST_F(DriveTest, LockstepRunsAtItsPace) {
  drive_ = Drive(welcome_of(v1::MODE_LOCKSTEP));
  order(R"({"op":"pace","pace":0.1})");
  begin(kOneVolt);
  const auto ticks_in = [this](std::chrono::milliseconds time) {
    int count = 0;
    for (const Drive::Time end = now_ + time; now_ < end; now_ += 1ms) {
      for (std::vector<v1::Envelope> all = asked(); !all.empty(); all = asked()) {
        ++count;
        answer_with_tick(all[0], 6 + all[0].exchange().commands(0).tick());
      }
    }
    return count;
  };
  EXPECT_NEAR(ticks_in(1000ms), 100, 1);
  order(R"({"op":"pace","pace":0})");
  EXPECT_EQ(ticks_in(500ms), 0);
  order(R"({"op":"step","ticks":7})");
  EXPECT_EQ(ticks_in(500ms), 7);
  order(R"({"op":"pace","pace":1})");
  EXPECT_NEAR(ticks_in(100ms), 100, 1);
}

// Catches: an order that is carried out in part, a text that ends the gateway, a refusal without field or
// rule.
TEST_F(DriveTest, AnOrderIsCarriedOutWholeOrRefused) {
  const auto problem_of = [this](const std::string& text) -> std::string {
    try {
      order(text);
    } catch (const OrderError& error) {
      return error.what();
    }
    return {};
  };
  const std::string axis =
      R"("gates":"voltage","constant":[1,0,0,0],"boost":0,"per_hz":0,"frequency_hz":0,"ramp_s":0)";
  const auto axes = [](const std::string& list) { return R"({"op":"drive","axes":[)" + list + "]}"; };
  EXPECT_EQ(problem_of("hello"), "the text is not JSON");
  EXPECT_EQ(problem_of(R"({"op":"pace","pace":1e999})"), "the text is not JSON");
  EXPECT_EQ(problem_of("[]"), "op: is missing");
  EXPECT_EQ(problem_of(R"({"op":"fly"})"),
            R"(op: "fly" is not one of drive, pace, step, presets, alive, run_suite, identify, cancel_run)");
  EXPECT_EQ(problem_of(R"({"op":"pace","pace":2})"), "pace: 2 is no number from 0 to 1");
  EXPECT_EQ(problem_of(R"({"op":"step","ticks":1.5})"), "ticks: 1.5 is no whole number");
  EXPECT_EQ(problem_of(axes(R"({"axis":1,)" + axis + "}")), "axis: 1 is no number from 0 to 0");
  EXPECT_EQ(problem_of(axes(R"({"axis":0,)" + axis + R"(},{"axis":0,)" + axis + "}")), "axis: 0 comes twice");
  EXPECT_EQ(problem_of(axes(R"({"axis":0,"gates":"on"})")),
            R"(gates: "on" is not one of off, voltage, current, duty)");
  EXPECT_EQ(problem_of(axes(R"({"axis":0,"preset":7,"run":1})")), "preset: 7 is no text");
  EXPECT_EQ(problem_of(axes(R"({"axis":0,"preset":"p"})")), "run: is missing");
  EXPECT_EQ(problem_of(axes(R"({"axis":0,"preset":"p","run":1})")).substr(0, 13), "no preset 'p'");
  EXPECT_EQ(problem_of(axes(R"({"axis":0,"gates":"duty","constant":[1]})")),
            "constant: is no list of four numbers");
  EXPECT_TRUE(drive_.is_over());
  EXPECT_EQ(problem_of(axes(R"({"axis":0,)" + axis + "}")), "");
  EXPECT_FALSE(drive_.is_over());
}

v1::Welcome servo_welcome() {
  v1::Welcome welcome = welcome_of(v1::MODE_REALTIME);
  welcome.mutable_bench()->set_period_s(125e-6);
  welcome.mutable_bench()->mutable_axes(0)->set_machine_kind("induction");
  welcome.mutable_bench()->mutable_axes(0)->set_drive_kind("voltage_amplifier");
  return welcome;
}

std::string run_order(const std::string& preset, int number) {
  return R"({"op":"drive","axes":[{"axis":0,"preset":")" + preset + R"(","run":)" + std::to_string(number) +
         "}]}";
}

// Catches: an order that is repeated and begins the run anew, a second run that does not begin, an open loop
// that the run goes on in, an order with a wrong preset that ends the run.
TEST_F(DriveTest, ARunGoesOnUntilAnotherOrder) {
  drive_ = Drive(servo_welcome());
  begin(run_order("book/8.2.2", 1));
  const auto run_text = [this] {
    drive_.tell({});
    const std::string report = drive_.report(now_);
    const std::size_t at = report.find("\"run\"");
    return at == std::string::npos ? std::string() : report.substr(at);
  };
  for (std::uint64_t tick = 6; tick < 30; ++tick)
    EXPECT_EQ(command_at(tick).gates(), v1::GATES_OFF);  // the axis rests first
  EXPECT_EQ(run_text().find(R"("run":{"number":1,"preset":"book/8.2.2","phase":"resting")"), 0u);
  for (std::uint64_t tick = 30; tick < 500; ++tick)
    command_at(tick);
  const std::string before = run_text();
  EXPECT_NE(before.find("preparing"), std::string::npos) << before;
  order(run_order("book/8.2.2", 1));
  EXPECT_THROW(order(run_order("book/9.1.4", 2)), OrderError);
  EXPECT_EQ(run_text(), before);
  order(run_order("book/8.2.2", 2));
  EXPECT_NE(run_text().find("resting"), std::string::npos);
  order(kOneVolt);
  EXPECT_EQ(run_text(), "");
  EXPECT_EQ(command_at(501).u_a_v(), 1.0);
}

// Catches: a controller that drives on without its page, one that lets go of the motor at once, a refusal
// that the run does not tell.
TEST_F(DriveTest, ARunWindsDownWithoutItsPageAndEndsWithARefusal) {
  drive_ = Drive(servo_welcome());
  begin(run_order("book/8.2.2", 1));
  std::uint64_t tick = 6;
  for (; tick < 420; ++tick)
    command_at(tick);
  EXPECT_EQ(command_at(tick++).gates(), v1::GATES_VOLTAGE);
  now_ += Drive::kSilence;
  EXPECT_EQ(command_at(tick++).gates(), v1::GATES_VOLTAGE);
  for (int k = 0; k < 7990; ++k)  // a second
    EXPECT_EQ(command_at(tick++).gates(), v1::GATES_VOLTAGE);
  for (int k = 0; k < 20 && !drive_.is_over(); ++k) {
    const std::vector<v1::Envelope> requests = asked();
    if (requests.at(0).has_exchange()) answer_with_tick(requests[0], tick++);
  }
  EXPECT_TRUE(drive_.is_over());
  begin(run_order("book/8.2.2", 2));
  refuse(asked().at(0), v1::REFUSAL_LATCHED, "a fault is latched");
  EXPECT_NE(drive_.report(now_).find("the bench refused: a fault is latched"), std::string::npos);
  EXPECT_EQ(command_at(tick + 5).gates(), v1::GATES_OFF);
}

// Catches: presets that the page must guess.
TEST_F(DriveTest, TellsThePresetsThatFit) {
  drive_ = Drive(servo_welcome());
  order(R"({"op":"presets"})");
  const std::string report = drive_.report(now_);
  EXPECT_NE(report.find(R"("presets":[[{"name":")"), std::string::npos) << report;
  EXPECT_NE(report.find(R"("book/8.2.2")"), std::string::npos);
  EXPECT_EQ(report.find(R"("book/9.1.4")"), std::string::npos);
  drive_.tell({});
  EXPECT_EQ(drive_.report(now_).find("presets"), std::string::npos);
}

OpenLoop star_axis() {
  return {2, 1e-3, {.phases = 3, .two_phase = false, .star = true}};
}

// Catches: phases that turn the other way round, an amplitude without boost, an angle that jumps with the
// frequency or counts commands in the place of ticks.
TEST(OpenLoop, TheAmplitudeRisesWithTheFrequency) {
  OpenLoop axis = star_axis();
  axis.follow({.gates = v1::GATES_VOLTAGE,
               .constant = {},
               .boost = 2.0,
               .per_hz = 0.5,
               .frequency_hz = 20.0,
               .ramp_s = 1.0});
  EXPECT_EQ(axis.command(100).u_a_v(), 2.0);  // the boost is there at once
  axis.command(350);
  axis.command(600);
  EXPECT_DOUBLE_EQ(axis.frequency_hz(), 10.0);
  EXPECT_DOUBLE_EQ(axis.amplitude(), 7.0);
  const v1::Command half = axis.command(604);
  // 20 Hz/s: after t the angle is a turn times 10 t².
  const double angle_rad = 2.0 * std::numbers::pi * 10.0 * 0.504 * 0.504;
  const double amplitude_v = 2.0 + 0.5 * 20.0 * 0.504;
  EXPECT_NEAR(half.u_a_v(), amplitude_v * std::cos(angle_rad), 1e-9);
  EXPECT_NEAR(half.u_b_v(), amplitude_v * std::cos(angle_rad - 2.0 * std::numbers::pi / 3.0), 1e-9);
  EXPECT_NEAR(half.u_a_v() + half.u_b_v() + half.u_c_v(), 0.0, 1e-9);
  EXPECT_EQ(half.axis(), 2u);
}

// Catches: a ramp that jumps to its end because the bench was reset: ticks that go back are no time.
TEST(OpenLoop, ABenchThatGoesBackTakesTheRampNoFurther) {
  OpenLoop axis = star_axis();
  axis.follow({.gates = v1::GATES_VOLTAGE,
               .constant = {},
               .boost = 2.0,
               .per_hz = 0.5,
               .frequency_hz = 20.0,
               .ramp_s = 1.0});
  axis.command(1000);
  axis.command(1500);
  const double before_v = axis.command(0).u_a_v();
  EXPECT_DOUBLE_EQ(axis.frequency_hz(), 10.0);
  EXPECT_EQ(axis.command(0).u_a_v(), before_v);
  axis.command(250);
  EXPECT_DOUBLE_EQ(axis.frequency_hz(), 15.0);
}

// Catches: duties of a star that begin or end at the negative rail, which is a voltage of half the link.
TEST(OpenLoop, DutiesOfAStarRestAtTheMiddle) {
  OpenLoop axis = star_axis();
  axis.follow({.gates = v1::GATES_DUTY,
               .constant = {.a = 0.6, .b = 0.5, .c = 0.4, .f = 0.0},
               .boost = 0.0,
               .per_hz = 0.0,
               .frequency_hz = 0.0,
               .ramp_s = 1.0});
  EXPECT_EQ(axis.command(0).d_a(), 0.5);
  EXPECT_NEAR(axis.command(500).d_a(), 0.55, 1e-12);
  axis.ramp_down(0.1);
  EXPECT_NEAR(axis.command(550).d_a(), 0.525, 1e-12);
  EXPECT_EQ(axis.command(600).d_c(), 0.5);
  EXPECT_TRUE(axis.has_arrived());
}

// Catches: a second start that jumps to the frequency of the first, or takes the time between them for one
// step.
TEST(OpenLoop, AStartAfterGatesOffBeginsAtRest) {
  OpenLoop axis = star_axis();
  const OpenLoopTarget target = {.gates = v1::GATES_CURRENT,
                                 .constant = {},
                                 .boost = 1.0,
                                 .per_hz = 0.1,
                                 .frequency_hz = 50.0,
                                 .ramp_s = 1.0};
  axis.follow(target);
  axis.command(0);
  axis.command(900);
  axis.switch_off();
  const v1::Command off = axis.command(901);
  EXPECT_EQ(off.gates(), v1::GATES_OFF);
  EXPECT_EQ(off.i_a_a(), 0.0);
  axis.follow(target);
  EXPECT_EQ(axis.command(5000).i_a_a(), 1.0);
  EXPECT_EQ(axis.frequency_hz(), 0.0);
}

}  // namespace
}  // namespace drivebench::web::drive_test
