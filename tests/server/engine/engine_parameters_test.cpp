// Events of the configuration, parameters and set-points as the engines handle them.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"
#include "tests/server/engine/engine_requests.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::engine_parameters_test {
namespace {

// Catches: an event of the configuration that never happens, on another axis, or at another tick.
TEST(Events, HappenAtTheirTickOnTheirAxis) {
  BenchConfig config = servo_bench(2);
  config.axes[1].events = {{0, ShaftBump{kServoInertia_kgm2}},
                           {1, write_of(servo_axis(), "amplifier.gain", 2.0)},
                           {2, fault_of("bus_sag", 0.5)},
                           {3, LoadChange{0.5, 0}}};
  Bench bench(config.setup);
  schedule_events(config, bench);
  EXPECT_EQ(bench.axis(1).state().shaft.speed_rad_s, 1.0) << "those of tick 0 at once";
  for (Tick tick = 1; tick <= 4; ++tick) {
    bench.step();
    EXPECT_EQ(value_of(bench.axis(1).parameters(), "amplifier.gain"), tick > 1 ? 2.0 : 1.0);
    EXPECT_EQ(bench.sample(1).injected != 0, tick > 2) << tick;
    EXPECT_EQ(bench.sample(1).load_nm, tick > 3 ? 0.5 : 0.0);
    EXPECT_EQ(bench.sample(0).injected + bench.sample(0).faults, 0u);
    EXPECT_EQ(bench.sample(0).speed_rad_s, 0.0);
  }
}

// Catches: a write whose limits, rules or read-back are lost between engine and table.
TEST(LockstepEngine, ParametersAreTriedBeforeTheyAreWritten) {
  const auto engine = make_lockstep_engine(servo_bench());
  const auto row = [](const char* name) { return row_of(servo_axis(), name); };
  EXPECT_EQ(engine->try_parameter(0, row("amplifier.gain"), 1.5), "");
  EXPECT_EQ(engine->parameters(0).drive.amplifier.gain, 1.5);
  EXPECT_NE(engine->try_parameter(0, row("amplifier.gain"), -1.0), "");
  EXPECT_NE(engine->try_parameter(0, row("amplifier.gain"), std::nan("")), "");
  EXPECT_NE(engine->try_parameter(0, row("mechanics.coulomb_friction_nm"), 1.0), "")
      << "static friction is 0";
  EXPECT_EQ(engine->parameters(0).drive.amplifier.gain, 1.5);
  EXPECT_EQ(engine->parameters(0).mechanics.coulomb_friction_nm, 0.0);
}

// Catches: a value that is shown as in force when the bench has another one: on a ramp, or later, or never.
TEST(LockstepEngine, ShowsTheParametersInForce) {
  const auto engine = make_lockstep_engine(servo_bench());
  const auto gain = [&engine] { return engine->parameters(0).drive.amplifier.gain; };
  ask(*engine, lease(LeaseAction::kAcquire));
  const ParameterWrite ramp = write_of(servo_axis(), "amplifier.gain", 3.0, 4);
  ASSERT_EQ(engine->try_parameter(0, ramp.row, ramp.value), "");
  EXPECT_EQ(ask(*engine, {.tick = 0, .axis = 0, .owner = kMe, .action = ramp}), Refused::kNot);
  std::vector<double> seen{gain()};
  for (Tick tick = 0; tick < 6; ++tick) {
    engine->command(0, kMe, voltage(tick, 1.0, 0.0));
    engine->advance();
    seen.push_back(gain());
  }
  EXPECT_EQ(seen, (std::vector<double>{1.0, 1.0, 1.5, 2.0, 2.5, 3.0, 3.0}));
  const ParameterWrite wrong{.row = ramp.row, .value = std::nan("")};
  EXPECT_EQ(ask(*engine, {.tick = 0, .axis = 0, .owner = kMe, .action = wrong}), Refused::kNotFinite);
  EXPECT_EQ(gain(), 3.0);
}

// Catches: currents that a bench without a current loop takes, and a mailbox that takes them first.
TEST(LockstepEngine, CurrentsNeedACurrentAmplifier) {
  const auto engine = make_lockstep_engine(servo_bench());
  ask(*engine, lease(LeaseAction::kAcquire));
  Command currents = voltage(0, 1.0, 0.0);
  currents.phases.gates = Gates::kCurrent;
  EXPECT_EQ(engine->check(0, kMe, currents), Refused::kWrongDrive);
  EXPECT_EQ(engine->command(0, kMe, currents), Refused::kWrongDrive);
}

// Catches: parameters that only the tick thread knows, an answer that comes before they are shown, a value
// that stays although the bench refused it.
TEST(ThreadedEngine, ShowsTheParametersInForce) {
  BenchConfig config = servo_bench(2);
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  const auto gain = [&engine] { return engine->parameters(1).drive.amplifier.gain; };
  const auto write = [](double value, Tick ramp_ticks = 0) -> Input {
    return {.tick = 0,
            .axis = 1,
            .owner = 0,
            .action = write_of(servo_axis(), "amplifier.gain", value, ramp_ticks)};
  };
  bool rising = false;
  EXPECT_EQ(engine->try_parameter(1, std::get<ParameterWrite>(write(1.5).action).row, 1.5), "");
  EXPECT_EQ(gain(), 1.5) << "on its way";
  engine->request(write(1.5), [&](Refused, Tick) {
    EXPECT_EQ(gain(), 1.5);
    engine->request(write(-1.0), [&](Refused refused, Tick) {
      EXPECT_EQ(refused, Refused::kOutOfRange);
      EXPECT_EQ(gain(), 1.5);
      engine->request(write(2.5, 2000), [&](Refused, Tick) { rising = gain() < 2.5; });
    });
  });
  bool between = false;
  engine->on_tick.add([&] {
    between = between || (gain() > 1.5 && gain() < 2.5);
    if (rising && gain() == 2.5) io.stop();
  });
  io.run();
  EXPECT_TRUE(between);
  EXPECT_EQ(engine->parameters(0).drive.amplifier.gain, 1.0);
  engine->stop();
}

// The bench takes sixteen ramps and refuses a seventeenth, which the engine had let through. Catches: a value
// that stays although the bench refused it.
TEST(ThreadedEngine, AWriteThatTheBenchRefusesIsTakenBack) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  const AxisParameters p = config.setup.axes[0].parameters;
  const auto ramp = [&](std::uint32_t row, double value, Engine::Answer answer) {
    EXPECT_EQ(engine->try_parameter(0, row, value), "");
    const ParameterWrite write{.row = row, .value = value, .ramp_ticks = 1'000'000'000};
    engine->request({.tick = 0, .axis = 0, .owner = 0, .action = write}, std::move(answer));
  };
  std::size_t ramps = 0;
  for (std::uint32_t row = 0; ramps < kMaxRamps; ++row) {
    const Parameter& parameter = axis_parameters(p)[row];
    if (!parameter.live || parameter.integer || parameter.name == "amplifier.gain") continue;
    ramp(row, parameter.get(p), [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
    ++ramps;
  }
  ramp(row_of(p, "amplifier.gain"), 9.0, [&](Refused refused, Tick) {
    EXPECT_EQ(refused, Refused::kTooManyRamps);
    EXPECT_EQ(engine->parameters(0).drive.amplifier.gain, 1.0);
    io.stop();
  });
  EXPECT_EQ(engine->parameters(0).drive.amplifier.gain, 9.0) << "on its way";
  io.run();
  engine->stop();
}

// While nothing is drained here, the first write stays without an answer. Catches: a write that is shown as
// undone because another one found no room.
TEST(ThreadedEngine, AWriteOnItsWayIsShownUntilItsAnswer) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  const ParameterWrite write = write_of(servo_axis(), "amplifier.gain", 1.5);
  int busy = 0;
  for (int n = 0; n < 20'000; ++n) {
    EXPECT_EQ(engine->try_parameter(0, write.row, write.value), "");
    engine->request({.tick = 0, .axis = 0, .owner = 0, .action = write},
                    [&busy](Refused refused, Tick) { busy += refused == Refused::kBusy ? 1 : 0; });
    ASSERT_EQ(engine->parameters(0).drive.amplifier.gain, 1.5);
  }
  EXPECT_GT(busy, 0);
  engine->stop();
}

// Catches: a check on the I/O thread that lets through what the bench then refuses.
TEST(ThreadedEngine, CurrentsNeedACurrentAmplifier) {
  BenchConfig config = servo_bench();
  config.mode = RunMode::kFree;
  asio::io_context io(1);
  const auto engine = make_threaded_engine(config, nullptr, io, std::nullopt);
  engine->request(lease(LeaseAction::kAcquire), [&](Refused, Tick) {
    Command command = voltage(0, 1.0, 0.0);
    command.phases.gates = Gates::kCurrent;
    EXPECT_EQ(engine->command(0, kMe, command), Refused::kWrongDrive);
    command = voltage(0, 1.0, 0.0);
    command.phases.setpoint.field = std::nan("");
    EXPECT_EQ(engine->command(0, kMe, command), Refused::kNotFinite);
    io.stop();
  });
  io.run();
  engine->stop();
}

}  // namespace
}  // namespace drivebench::engine_parameters_test
