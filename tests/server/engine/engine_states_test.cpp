#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::engine_states_test {
namespace {

constexpr Tick kRunTicks = 20'000;

/// Two axes without controllers, whose loads change: the sample of a tick depends on the tick alone.
BenchConfig two_free_axes() {
  BenchConfig config = servo_bench(2);
  config.mode = RunMode::kFree;
  config.axes[0].events = {{.tick = 100, .action = LoadChange{.load_nm = 0.2, .ramp_ticks = 50}}};
  config.axes[1].events = {{.tick = 700, .action = LoadChange{.load_nm = -0.1, .ramp_ticks = 0}}};
  return config;
}

std::vector<Sample> direct_samples(const BenchConfig& config) {
  Bench bench(config.setup);
  schedule_events(config, bench);
  std::vector<Sample> samples;
  samples.reserve(static_cast<std::size_t>(2 * (kRunTicks + 1)));
  for (;;) {
    for (std::size_t axis = 0; axis < 2; ++axis)
      samples.push_back(bench.sample(axis));
    if (bench.tick() == kRunTicks) return samples;
    bench.step();
  }
}

// The tick thread runs all the while. Catches: a state that is read or written in the middle of a tick, a
// sample of the time before that comes after the restore, a tick thread that does not go on.
TEST(EngineStates, AFreeRunGoesBackAndForthAndStaysTheSameRun) {
  const BenchConfig config = two_free_axes();
  const std::vector<Sample> direct = direct_samples(config);
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, kRunTicks);
  std::vector<std::vector<std::byte>> saved;
  std::size_t wrong = 0;
  std::size_t set_back = 0;
  Tick restored = -1;
  engine->on_set_back.add([&] { ++set_back; });
  engine->on_tick.add([&] {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const Sample& newest = engine->newest(axis);
      const Sample& expected = direct[2 * newest.tick + axis];
      if (std::memcmp(&newest, &expected, sizeof(Sample)) != 0) ++wrong;
    }
    if (restored >= 0 && engine->tick() < restored) ++wrong;
  });
  std::function<void()> jump = [&] {
    if (saved.size() == 60) return;
    saved.push_back(engine->save());
    const std::size_t which = saved.size() / 2;
    restored = -1;
    if (which % 5 == 0) {
      engine->reset();
      EXPECT_EQ(engine->tick(), 0);
    } else {
      EXPECT_TRUE(engine->restore(saved[which]));
    }
    restored = engine->tick();
    asio::post(io, jump);
  };
  asio::post(io, jump);
  engine->on_end = [&] { io.stop(); };
  io.run();
  const Verdict verdict = engine->stop();
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(set_back, 60u);
  EXPECT_EQ(verdict.ticks, static_cast<std::uint64_t>(kRunTicks));
}

// Catches: clients that go on reading the parameters of the time before, and bytes of another bench.
TEST(EngineStates, ParametersGoBackToo) {
  BenchConfig config = servo_bench(1);
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  for (const bool lockstep : {false, true}) {
    const auto engine = lockstep ? make_lockstep_engine(servo_bench(1), nullptr, io)
                                 : make_threaded_engine(config, nullptr, io, std::nullopt);
    const auto row =
        static_cast<std::uint32_t>(find_parameter(engine->parameters(0), "machine.rotor_resistance_ohm") -
                                   axis_parameters(engine->parameters(0)).data());
    const auto value = [&] { return axis_parameters(engine->parameters(0))[row].get(engine->parameters(0)); };
    const double before = value();
    const std::vector<std::byte> saved = engine->save();
    ASSERT_EQ(engine->try_parameter(0, row, 2.0 * before), "");
    bool answered = false;
    engine->request(
        {.tick = 0, .axis = 0, .owner = 0, .action = ParameterWrite{.row = row, .value = 2.0 * before}},
        [&](Refused refused, Tick) {
          EXPECT_EQ(refused, Refused::kNot);
          answered = true;
        });
    while (!answered)
      io.run_one();
    EXPECT_EQ(value(), 2.0 * before);
    EXPECT_TRUE(engine->restore(saved));
    EXPECT_EQ(value(), before);
    EXPECT_FALSE(engine->restore(std::span(saved).first(100)));
    EXPECT_FALSE(engine->restore({}));
    engine->stop();
  }
}

}  // namespace
}  // namespace drivebench::engine_states_test
