#include "server/engine/answer_clock.hpp"

#include <gtest/gtest.h>

namespace drivebench::answer_clock_test {
namespace {

constexpr Owner kFirst = 1;
constexpr Owner kSecond = 2;
constexpr std::int64_t kStart_ns = 1'000'000'000;

/// A clock that stands where a test puts it.
class AnswerClocks : public ::testing::Test {
 protected:
  ~AnswerClocks() override { ServerClock::simulate(ServerClock::time_point(ServerClock::duration(-1))); }

  void sample(Tick tick, std::int64_t at_ns) {
    go_to(at_ns);
    clock_.sample_leaves(tick);
  }
  void command(Tick answers, std::int64_t at_ns, AnswerClock::Period period = {}, Owner owner = kFirst) {
    go_to(at_ns);
    Command command;
    command.answers = answers;
    clock_.command_comes(owner, command, period);
  }
  const AnswerTimes& times() const { return clock_.times(); }

 private:
  static void go_to(std::int64_t at_ns) {
    ServerClock::simulate(ServerClock::time_point(ServerClock::duration(kStart_ns + at_ns)));
  }

  AnswerClock clock_;
};

// Catches: a device that is charged for the time before its lease, or twice for one sample.
TEST_F(AnswerClocks, CountTheFirstCommandForEachSampleButThatOfALease) {
  sample(1, 0);
  command(1, 900'000);  // starts, and finds this sample there
  EXPECT_EQ(times().after_sample.count(), 0u);
  sample(2, 1'000'000);
  command(2, 1'000'100);
  command(2, 1'000'900);  // a newer one for the same sample
  sample(3, 2'000'000);
  command(3, 2'000'050);
  EXPECT_EQ(times().after_sample.count(), 2u);
  EXPECT_EQ(times().after_sample.smallest_ns(), 50);
  EXPECT_EQ(times().after_sample.worst_ns(), 100);
  sample(4, 3'000'000);
  command(4, 3'500'000, {}, kSecond);
  EXPECT_EQ(times().after_sample.worst_ns(), 100) << "the first of another lease";
  EXPECT_EQ(times().after_tick.count(), 0u) << "no real time";
}

// Catches: a late answer that counts as one in time, a phase against another tick than that of the sample.
TEST_F(AnswerClocks, InRealTimeTellThePhaseAndTheLateAnswers) {
  const auto period_of = [](Tick tick) {
    return AnswerClock::Period{.begin_ns = kStart_ns + tick * 100'000, .length_ns = 100'000};
  };
  command(0, 50'000, period_of(0));
  sample(1, 105'000);
  command(1, 135'000, period_of(1));
  sample(2, 207'000);
  sample(3, 310'000);
  command(2, 300'000 + 12'000, period_of(2));
  EXPECT_EQ(times().after_sample.smallest_ns(), 30'000);
  EXPECT_EQ(times().after_sample.worst_ns(), 105'000);
  EXPECT_EQ(times().after_tick.smallest_ns(), 35'000);
  EXPECT_EQ(times().after_tick.worst_ns(), 112'000);
  EXPECT_EQ(times().late, 1u);
}

// Catches: an answer to a sample that is forgotten by then, which would hide the worst ones.
TEST_F(AnswerClocks, InRealTimeAVeryLateAnswerCountsFromItsTick) {
  command(0, 0, {.begin_ns = kStart_ns, .length_ns = 100'000});
  for (Tick tick = 1; tick < 1000; ++tick)
    sample(tick, tick * 100'000 + 5'000);
  command(1, 100'000'000, {.begin_ns = kStart_ns + 100'000, .length_ns = 100'000});
  EXPECT_EQ(times().after_sample.worst_ns(), 99'900'000);
  EXPECT_EQ(times().late, 1u);
}

}  // namespace
}  // namespace drivebench::answer_clock_test
