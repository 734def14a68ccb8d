#include "server/messages/device_messages.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "server/host/logging/log.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::device_messages_test {
namespace {

Condition condition_of(const std::string& text) {
  return std::get<NamedCondition>(parse_condition(text)).condition;
}

/// A lockstep bench with messages, whose lines go to a plain file.
struct TalkingBench {
  explicit TalkingBench(std::vector<DeviceMessage> messages)
      : engine(make_lockstep_engine(servo_bench())),
        sent((make_file(), std::move(messages)), file, send_frame()) {
    sent.serve(*engine);
    ask(*engine, lease(LeaseAction::kAcquire));
  }

  std::string make_file() {
    file = (folder / "lines").string();
    std::ofstream(file).close();
    return file;
  }
  DeviceMessages::SendFrame send_frame() {
    return [this](std::size_t bus, const can::Frame& frame) {
      frames.push_back({bus, frame});
      return frame.id == 9 ? std::string("the bus is DOWN") : std::string();
    };
  }
  std::string lines() const {
    std::stringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  void run_to(Tick end) {
    for (Tick tick = engine->tick(); tick < end; ++tick) {
      engine->command(0, kMe, voltage(tick, 1.0, 0.0));
      engine->advance();
    }
  }

  TestFolder folder;
  std::string file;
  std::vector<std::pair<std::size_t, can::Frame>> frames;
  std::unique_ptr<Engine> engine;
  DeviceMessages sent;
};

DeviceMessage line(Tick tick, const std::string& text, std::optional<Trigger> trigger = std::nullopt) {
  return {.tick = tick, .trigger = trigger, .content = LineMessage{text}};
}

// Catches: a message a tick early or late, or twice; one of tick 0 that waits for a tick.
TEST(DeviceMessages, ComeOnceInTheirTick) {
  TalkingBench bench({line(3, "three"), line(0, "zero")});
  EXPECT_EQ(bench.lines(), "zero\n");
  bench.run_to(2);
  EXPECT_EQ(bench.lines(), "zero\n");
  bench.run_to(3);
  EXPECT_EQ(bench.lines(), "zero\nthree\n");
  bench.run_to(9);
  EXPECT_EQ(bench.lines(), "zero\nthree\n");
}

// Catches: a condition that need not hold in a row, a delay that is forgotten or counts from the first tick.
TEST(DeviceMessages, WaitForTheirConditionAsEventsDo) {
  TalkingBench bench({line(2, "later", Trigger{.condition = condition_of("tick >= 5"), .for_ticks = 3}),
                      line(0, "never", Trigger{.condition = condition_of("tick == 5"), .for_ticks = 1})});
  bench.run_to(9);
  EXPECT_EQ(bench.lines(), "") << "holds in the samples 5 to 8, and two ticks are to pass";
  bench.run_to(10);
  EXPECT_EQ(bench.lines(), "later\n");
  bench.run_to(30);
  EXPECT_EQ(bench.lines(), "later\n");
}

// Catches: a bench that is reset and tells its device nothing any more.
TEST(DeviceMessages, BeginAnewWithTheRun) {
  TalkingBench bench({line(3, "three"), line(0, "holds", Trigger{.condition = condition_of("tick >= 2")})});
  bench.run_to(5);
  EXPECT_EQ(bench.lines(), "holds\nthree\n");
  bench.engine->reset();
  bench.run_to(5);
  EXPECT_EQ(bench.lines(), "holds\nthree\nholds\nthree\n");
}

// Catches: a failure that is not told, or told of another message.
TEST(DeviceMessages, TellWhatBecameOfEach) {
  TalkingBench bench(
      {line(1, "a"),
       {.tick = 2, .content = FrameMessage{.bus = 1, .frame = {.id = 9}}},
       {.tick = 3, .content = FrameMessage{.bus = 0, .frame = {.id = 0x201, .size = 1, .data = {15}}}}});
  bench.run_to(4);
  const auto outcomes = bench.sent.outcomes();
  ASSERT_EQ(outcomes.size(), 3U);
  EXPECT_EQ(outcomes[0].text, "line \"a\"");
  EXPECT_EQ(outcomes[1].problem, "the bus is DOWN");
  EXPECT_EQ(outcomes[1].text, "frame 009# on bus 1");
  EXPECT_EQ(outcomes[2].problem, "");
  EXPECT_EQ(outcomes[2].text, "frame 201#0f");
  EXPECT_EQ(outcomes[2].tick, 3);
  EXPECT_EQ(bench.frames[1].second.data[0], 15);
}

// Catches: a pipe that nothing reads, and a bench that then stands still or says nothing.
TEST(DeviceMessages, AFullPipeIsAProblemAndNoWait) {
  const TestFolder folder;
  const std::string fifo = (folder / "fifo").string();
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  std::vector<DeviceMessage> messages;
  for (int i = 0; i < 200; ++i)
    messages.push_back(line(0, std::string(499, 'x')));
  DeviceMessages sent(std::move(messages), fifo, {});
  const auto engine = make_lockstep_engine(servo_bench());
  log::set_level(LogLevel::kOff);  // it warns of each
  sent.serve(*engine);
  log::set_level(LogLevel::kInfo);
  const auto outcomes = sent.outcomes();
  EXPECT_EQ(outcomes.front().problem, "");
  EXPECT_EQ(outcomes.back().problem, "the device does not read its standard input, which is full");
  EXPECT_THROW(DeviceMessages({line(0, "a")}, "", {}), std::runtime_error);
}

}  // namespace
}  // namespace drivebench::device_messages_test
