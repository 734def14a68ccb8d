#include <drivebench.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <drivebench.hpp>
#include <filesystem>
#include <fstream>
#include <limits>
#include <new>
#include <string>
#include <vector>

namespace {

std::size_t allocations = 0;

}  // namespace

// Not inlined: g++ would take the malloc() in one for a mistake beside the free() in the other.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* const memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++allocations;
  return std::malloc(size);
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  std::free(memory);
}
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

namespace drivebench::client {
namespace {

const std::string kServo = "inproc:" DRIVEBENCH_CONFIGS "/benches/servo.toml";
const std::string kDynamometer = "inproc:" DRIVEBENCH_CONFIGS "/benches/dynamometer.toml";

/// A shipped bench and some more lines, as the address of a bench file of its own.
std::string variant_of(const std::string& bench, const std::string& more) {
  std::ifstream shipped(DRIVEBENCH_CONFIGS "/benches/" + bench + ".toml");
  std::string text((std::istreambuf_iterator<char>(shipped)), {});
  text.replace(text.find("../motors/"), 10, DRIVEBENCH_CONFIGS "/motors/");
  const auto file = std::filesystem::temp_directory_path() /
                    ("drivebench-sdk-" + bench + "-" + std::to_string(::getpid()) + ".toml");
  std::ofstream(file) << text << more;
  return "inproc:" + file.string();
}

/// The BM500 behind its switched inverter, with voltage sensors against the negative rail.
const std::string kStar = variant_of("bm500", "\n[axis.voltage_sensor]\nagainst_rail = true\n");

/// Runs `ticks` with rotating voltages on axis 0 and returns the last sample.
Sample turn(Bench& bench, std::uint64_t ticks) {
  Sample sample = bench.newest();
  for (const std::uint64_t end = sample.tick + ticks; sample.tick < end;) {
    const double phase = 0.05 * static_cast<double>(sample.tick);
    sample = bench.step({.gates = DRIVEBENCH_GATES_VOLTAGE,
                         .tick = sample.tick,
                         .setpoint_a = 20.0 * std::cos(phase),
                         .setpoint_b = 20.0 * std::sin(phase)});
  }
  return sample;
}

/// The code and the sentence of the refusal of a request.
template <class Request>
Error refusal_of(Request request) {
  try {
    request();
  } catch (const Error& error) {
    return error;
  }
  return {DRIVEBENCH_OK, "", ""};
}

// Catches: a null pointer that ends the program instead of the call.
TEST(Sdk, NullPointersAreRefusedByName) {
  drivebench_bench* bench = nullptr;
  EXPECT_EQ(drivebench_open(nullptr, nullptr, &bench), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_STREQ(drivebench_error(nullptr), "address is a null pointer");
  EXPECT_EQ(drivebench_open(kServo.c_str(), nullptr, nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_acquire(nullptr, 0), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_describe(nullptr), nullptr);
  drivebench_close(nullptr);

  ASSERT_EQ(drivebench_open(kServo.c_str(), nullptr, &bench), DRIVEBENCH_OK);
  const drivebench_command command{};
  double value = 0.0;
  EXPECT_EQ(drivebench_step(bench, nullptr, 1, nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_STREQ(drivebench_error_field(bench), "commands");
  EXPECT_EQ(drivebench_step(bench, &command, 0, nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_STREQ(drivebench_error_field(bench), "count");
  EXPECT_EQ(drivebench_newest(bench, 0, nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_get(bench, 0, nullptr, &value), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_get(bench, 0, "machine.pole_pairs", nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_set(bench, 0, nullptr, 0.0, 0, 0), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_inject(bench, 0, nullptr, 0.0, 0), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_state_hash(bench, nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_save(bench, nullptr, nullptr), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_restore(bench, nullptr, 8), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(drivebench_newest(bench, 1, reinterpret_cast<drivebench_sample*>(&value)),
            DRIVEBENCH_UNKNOWN_AXIS);
  drivebench_close(bench);
}

// Catches: a sample that a refused step has half written, or emptied.
TEST(Sdk, ARefusedStepLeavesTheSampleOfTheCallerAsItWas) {
  Bench bench(kServo);
  bench.acquire();
  Sample sample{};
  bench.step({}, sample);
  EXPECT_EQ(sample.tick, 1u);
  const Sample before = sample;
  EXPECT_EQ(refusal_of([&] { bench.step({.axis = 7}, sample); }).code(), DRIVEBENCH_UNKNOWN_AXIS);
  EXPECT_EQ(std::memcmp(&sample, &before, sizeof(Sample)), 0);
  bench.step({.tick = 1}, sample);
  EXPECT_EQ(std::memcmp(&sample, &static_cast<const Sample&>(bench.newest()), sizeof(Sample)), 0);
}

// Catches: the sentence of an earlier call shown as that of the last.
TEST(Sdk, ASentenceIsForgottenByTheNextCall) {
  Bench bench(kServo);
  EXPECT_EQ(refusal_of([&] { bench.step({}); }).code(), DRIVEBENCH_NOT_OWNER);
  bench.acquire();
  drivebench_bench* raw = nullptr;
  ASSERT_EQ(drivebench_open(kServo.c_str(), nullptr, &raw), DRIVEBENCH_OK);
  EXPECT_NE(drivebench_release(raw, 0), DRIVEBENCH_OK);
  EXPECT_STRNE(drivebench_error(raw), "");
  EXPECT_EQ(drivebench_acquire(raw, 0), DRIVEBENCH_OK);
  EXPECT_STREQ(drivebench_error(raw), "");
  drivebench_close(raw);
}

// Catches: a program with another layout of structs that runs into memory that is not its own.
TEST(Sdk, AHeaderOfAnotherAbiIsRefused) {
  drivebench_bench* bench = nullptr;
  EXPECT_EQ(
      drivebench_open_abi(kServo.c_str(), nullptr, DRIVEBENCH_ABI + 1, sizeof(drivebench_sample), &bench),
      DRIVEBENCH_OTHER_ABI);
  EXPECT_EQ(bench, nullptr);
  EXPECT_EQ(
      drivebench_open_abi(kServo.c_str(), nullptr, DRIVEBENCH_ABI, sizeof(drivebench_sample) + 8, &bench),
      DRIVEBENCH_OTHER_ABI);
  EXPECT_NE(std::string(drivebench_error(nullptr)).find("header of another drivebench"), std::string::npos);
}

// Catches: a library with a new signal that writes beyond the sample of a program built before.
TEST(Sdk, AProgramWithAnOlderHeaderGetsTheSignalsThatItKnows) {
  constexpr std::size_t kKnown = sizeof(drivebench_sample) / 8 - 2;
  std::array<std::uint64_t, kKnown + 1> room;
  room.fill(0x5a5a5a5a5a5a5a5a);
  drivebench_bench* bench = nullptr;
  ASSERT_EQ(drivebench_open_abi(kServo.c_str(), nullptr, DRIVEBENCH_ABI, 8 * kKnown, &bench), DRIVEBENCH_OK);
  ASSERT_EQ(drivebench_acquire(bench, 0), DRIVEBENCH_OK);
  const drivebench_command command{};
  ASSERT_EQ(drivebench_step(bench, &command, 1, reinterpret_cast<drivebench_sample*>(room.data())),
            DRIVEBENCH_OK);
  EXPECT_EQ(room[0], 1u) << "the tick";
  EXPECT_NE(room[kKnown - 1], 0x5a5a5a5a5a5a5a5a) << "the last one that it knows";
  EXPECT_EQ(room[kKnown], 0x5a5a5a5a5a5a5a5a);
  drivebench_close(bench);
}

// Catches: an event that is not told, that acts elsewhere than in its tick or not at all, and a reset that
// leaves it done.
TEST(Sdk, EventsOfTheBenchFileAreTold) {
  Bench bench(variant_of("servo",
                         "\n[[axis.fault]]\nname = \"bus_sag\"\nvalue = 0.25\nwhen = \"command_tick >= 20\"\n"
                         "for_ticks = 4\ndelay_ticks = 10\n"));
  ASSERT_EQ(bench.describe().event_count, 1u);
  EXPECT_EQ(std::string(bench.describe().events[0].text),
            "fault bus_sag = 0.25 10 ticks after command_tick >= 20 for 4 ticks");
  for (int run = 0; run < 2; ++run) {
    bench.acquire();
    EXPECT_EQ(bench.event_tick(0), std::nullopt);
    turn(bench, 100);
    EXPECT_EQ(bench.event_tick(0), 35)
        << "command 20 shows in sample 21, the condition still holds in sample 25";
    bench.reset();
  }
  EXPECT_EQ(refusal_of([&] { bench.event_tick(1); }).code(), DRIVEBENCH_BAD_ARGUMENT);
}

// Catches: a reset that forgets a parameter, a scheduled change or the noise, or that takes the lease.
TEST(Sdk, AResetBenchRepeatsItsRun) {
  Bench bench(kServo);
  const std::uint64_t start = bench.state_hash();
  bench.acquire();
  std::array<std::uint64_t, 2> hashes{};
  for (std::uint64_t& hash : hashes) {
    bench.set("machine.rotor_resistance_ohm", 5.0, 0, {.ramp_ticks = 10, .at_tick = 50});
    bench.set_load(0.05, 0, {.ramp_ticks = 0, .at_tick = 100'000});
    turn(bench, 200);
    hash = bench.state_hash();
    bench.reset();
    EXPECT_EQ(bench.newest().tick, 0u);
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_NE(hashes[0], start);
  bench.release();
  EXPECT_EQ(refusal_of([&] { bench.step({}); }).code(), DRIVEBENCH_NOT_OWNER);
  bench.reset();
  EXPECT_EQ(bench.state_hash(), start);
}

// Catches: a part of the state that a saved bench leaves out, and a bench that takes any bytes for a state.
TEST(Sdk, ASavedBenchGoesOnElsewhere) {
  Bench bench(kServo);
  bench.acquire();
  turn(bench, 100);
  const std::vector<std::byte> saved = bench.save();
  const Sample here = turn(bench, 100);

  Bench other(kServo);
  other.acquire();
  other.restore(saved);
  const Sample there = turn(other, 100);
  EXPECT_EQ(std::memcmp(&here, &there, sizeof here), 0);
  EXPECT_EQ(bench.state_hash(), other.state_hash());

  const std::uint64_t before = other.state_hash();
  std::vector<std::byte> damaged = saved;
  for (std::size_t i = 0; i < damaged.size(); i += 97) {
    damaged[i] ^= std::byte{0x40};
    EXPECT_EQ(refusal_of([&] { other.restore(damaged); }).code(), DRIVEBENCH_MALFORMED) << "byte " << i;
    damaged[i] ^= std::byte{0x40};
  }
  EXPECT_EQ(refusal_of([&] { other.restore(std::span(saved).first(8)); }).code(), DRIVEBENCH_MALFORMED);
  EXPECT_EQ(refusal_of([&] { Bench(kDynamometer).restore(saved); }).code(), DRIVEBENCH_MALFORMED);
  EXPECT_EQ(other.state_hash(), before);

  std::array<std::byte, 8> small{};
  std::size_t size = small.size();
  drivebench_bench* raw = nullptr;
  ASSERT_EQ(drivebench_open(kServo.c_str(), nullptr, &raw), DRIVEBENCH_OK);
  EXPECT_EQ(drivebench_save(raw, small.data(), &size), DRIVEBENCH_BAD_ARGUMENT);
  EXPECT_EQ(size, saved.size()) << "the room that it takes";
  drivebench_close(raw);
}

// Catches: a step that waits for a command that no other controller can send, one of two commands taken
// alone.
TEST(Sdk, TwoAxesStepTogetherOrNotAtAll) {
  Bench bench(kDynamometer);
  ASSERT_EQ(bench.describe().axis_count, 2u);
  bench.acquire(0);
  bench.acquire(1);
  const Command first{.axis = 0};
  const Command second{.axis = 1};
  const std::uint64_t before = bench.state_hash();
  const Error alone = refusal_of([&] { bench.step(first); });
  EXPECT_EQ(alone.code(), DRIVEBENCH_BUSY);
  EXPECT_NE(std::string(alone.what()).find("axis 1"), std::string::npos);
  std::array<Sample, 2> samples{};
  const std::array twice = {first, first};
  EXPECT_EQ(refusal_of([&] { bench.step(twice, samples); }).code(), DRIVEBENCH_OUT_OF_RANGE);
  EXPECT_EQ(bench.state_hash(), before);

  const std::array one_wrong = {first, Command{.axis = 1,
                                               .gates = DRIVEBENCH_GATES_VOLTAGE,
                                               .setpoint_a = std::numeric_limits<double>::quiet_NaN()}};
  EXPECT_EQ(refusal_of([&] { bench.step(one_wrong, samples); }).code(), DRIVEBENCH_NOT_FINITE);
  EXPECT_EQ(bench.newest().tick, 0u);
  const std::array swapped = {second, first};
  bench.step(swapped, samples);
  EXPECT_EQ(samples[0].tick, 1u);
  EXPECT_EQ(samples[1].tick, 1u);
  EXPECT_EQ(std::memcmp(&samples[1], &static_cast<const Sample&>(bench.newest(0)), sizeof(Sample)), 0);
}

// Catches: an axis that stays latched although its new controller asked for a clean one, or is cleared
// unasked.
TEST(Sdk, WhatIsLatchedIsClearedOnlyIfAsked) {
  for (const bool clears : {false, true}) {
    Bench bench(kServo, {.token = nullptr,
                         .client = nullptr,
                         .deadline_ms = 0,
                         .clear_on_acquire = clears ? 1 : 0,
                         .conducts = 0});
    bench.acquire();
    turn(bench, 20);
    bench.inject("command_loss", 1.0);
    refusal_of([&] { turn(bench, 100); });  // longer than the watchdog
    bench.inject("command_loss", 0.0);
    const std::uint64_t tick = bench.newest().tick;
    EXPECT_EQ(refusal_of([&] { bench.step({.gates = DRIVEBENCH_GATES_VOLTAGE, .tick = tick}); }).code(),
              DRIVEBENCH_LATCHED);
    bench.acquire();
    EXPECT_EQ(refusal_of([&] { bench.step({.gates = DRIVEBENCH_GATES_VOLTAGE, .tick = tick}); }).code(),
              clears ? DRIVEBENCH_OK : DRIVEBENCH_LATCHED);
  }
}

// Catches: duties without their common part, which the currents of a star do not show.
TEST(Sdk, ACommonDutyReachesTheTerminals) {
  Bench bench(kStar);
  bench.acquire();
  for (const double duty : {0.0, 0.25, 1.0}) {
    Sample sample = bench.newest();
    for (int k = 0; k < 3; ++k) {
      sample = bench.step({.gates = DRIVEBENCH_GATES_DUTY,
                           .tick = sample.tick,
                           .setpoint_a = duty,
                           .setpoint_b = duty,
                           .setpoint_c = duty});
    }
    EXPECT_NEAR(sample.terminal_a_mean_v, duty * sample.bus_voltage_v, 1e-9);
    EXPECT_NEAR(sample.true_i_a_a, 0.0, 1e-12);
  }
}

// Catches: a leg that is off and yet drives its phase.
TEST(Sdk, ALegThatIsOffCarriesNoCurrentAtRest) {
  Bench bench(kStar);
  bench.acquire();
  Sample sample = bench.newest();
  for (int k = 0; k < 20; ++k) {
    sample = bench.step({.gates = DRIVEBENCH_GATES_DUTY,
                         .tick = sample.tick,
                         .setpoint_a = 0.52,
                         .setpoint_b = 0.48,
                         .setpoint_c = 0.9,
                         .legs_off = 4});
  }
  EXPECT_GT(sample.true_i_a_a, 0.1);
  EXPECT_NEAR(sample.true_i_a_a + sample.true_i_b_a, 0.0, 1e-9);
  EXPECT_NEAR(sample.true_i_c_a, 0.0, 1e-9);
}

// Catches: memory taken in a step, which has no bound on time.
TEST(Sdk, StepsInProcessAllocateNothing) {
  Bench bench(kServo);
  bench.acquire();
  turn(bench, 10);
  const std::size_t before = allocations;
  turn(bench, 1000);
  EXPECT_EQ(allocations, before);
  const std::vector<std::byte> saved = bench.save();
  EXPECT_GT(allocations, before) << "the count sees the library";
}

// Catches: bytes of a state or of set-points that end the program. A local engine with a literal seed.
TEST(Sdk, AnyCommandIsTakenOrRefusedInWords) {
  Bench bench(kServo);
  bench.acquire();
  std::uint64_t random = 20261124;
  const auto next = [&random] { return random = random * 6364136223846793005u + 1442695040888963407u; };
  std::size_t refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::array<std::uint64_t, sizeof(Command) / 8> words;
    for (std::uint64_t& word : words)
      word = next();
    Command command = std::bit_cast<Command>(words);
    if (next() >> 62 == 0) command.axis = 0;
    if (next() >> 62 != 0) command.gates &= 3;
    if (next() >> 62 != 0) command.legs_off &= 7;
    if (next() >> 62 != 0) command.tick = bench.newest().tick;
    const Error error = refusal_of([&] { bench.step(command); });
    if (error.code() != DRIVEBENCH_OK) {
      ++refused;
      ASSERT_GT(std::strlen(error.what()), 10u);
    }
  }
  EXPECT_GT(refused, 1000u);
  EXPECT_LT(refused, 20'000u);
}

}  // namespace
}  // namespace drivebench::client
