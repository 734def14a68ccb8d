#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <vector>

#include "plant/parameters/parameters.hpp"
#include "tests/repetitions.hpp"
#include "tests/server/bench/servo_bench.hpp"

namespace drivebench {
namespace {

constexpr Owner kOwner = 3;

/// Two axes with friction, noise and a coarse converter: each has a state.
BenchSetup rich_setup() {
  BenchSetup setup = servo_setup(1);
  AxisParameters& p = setup.axes[0].parameters;
  p.mechanics.coulomb_friction_nm = 0.01;
  p.mechanics.static_friction_nm = 0.02;
  p.sensors.current = {.bits = 12, .full_scale_a = 20.0, .noise_rms_a = 0.02};
  p.encoder.half_count_offset = true;
  setup.axes.push_back({.parameters = servo_axis(), .on_link_loss = SafeAction::kZeroVoltage});
  return setup;
}

/// One tick of a run whose inputs depend on the tick only.
void drive(Bench& bench, double last_bit_of_tick_100 = 0.0) {
  const Tick tick = bench.tick();
  if (tick % 16'000 == 0) submit_lease(bench, LeaseAction::kAcquire, kOwner);
  const double phase = 0.002 * static_cast<double>(tick % 5000);
  double a_v = 30.0 * (phase < 5.0 ? 1.0 : -1.0);
  if (tick == 100) a_v += last_bit_of_tick_100;
  submit_volts(bench, kOwner, a_v, 4.0 * phase);
  if (tick % 1000 == 0) {
    bench.submit({.tick = tick + 500,
                  .axis = 1,
                  .owner = 0,
                  .action = LoadChange{.load_nm = tick % 2000 == 0 ? 0.02 : -0.02, .ramp_ticks = 300}});
  }
  bench.step();
}

void run_to(Bench& bench, Tick end) {
  while (bench.tick() < end)
    drive(bench);
}

std::uint64_t hash_at(const BenchSetup& setup, Tick tick, double last_bit = 0.0) {
  Bench bench(setup);
  while (bench.tick() < tick)
    drive(bench, last_bit);
  return bench.state_hash();
}

bool same_samples(const Bench& a, const Bench& b) {
  for (std::size_t i = 0; i < a.axis_count(); ++i) {
    if (std::memcmp(&a.sample(i), &b.sample(i), sizeof(Sample)) != 0) return false;
  }
  return true;
}

// The tick of the save lies within a load ramp and a parameter ramp, before scheduled inputs, under a fault
// and after a live write. Catches: any piece of state that is not saved, and any that depends on the past of
// the process.
TEST(BenchState, DET_05_ARestoredBenchContinuesBitForBitForAMillionTicks) {
  Bench original(rich_setup());
  run_to(original, 1200);
  original.submit({.tick = original.tick(),
                   .axis = 0,
                   .owner = 0,
                   .action = write_of(servo_axis(), "machine.rotor_resistance_ohm", 5.0)});
  const auto submit = [&](const Action& action, std::uint32_t axis, Tick tick) {
    original.submit({.tick = tick, .axis = axis, .owner = 0, .action = action});
  };
  submit(write_of(servo_axis(), "machine.stator_resistance_ohm", 2.5, 5000), 0, 2000);
  submit(write_of(servo_axis(), "mechanics.viscous_friction_nms", 1e-3, 100), 1, 4300);
  submit(fault_of("current_sensor_gain", -0.1), 0, 2500);
  submit(fault_of("rotor_resistance_drift", 0.5), 1, 5000);
  submit(ShaftBump{1e-5}, 1, 4000);
  original.submit({.tick = 4321, .axis = 0, .owner = 0, .action = LoadChange{0.03, 17}});
  original.submit({.tick = 4321, .axis = 1, .owner = 0, .action = LoadChange{0.01, 0}});
  run_to(original, 2600);
  const std::vector<std::byte> saved = original.save();

  Bench copy(rich_setup());
  run_to(copy, 77);  // a past of its own, which must leave no trace
  ASSERT_TRUE(copy.restore(saved));
  EXPECT_EQ(copy.tick(), 2600);
  EXPECT_EQ(copy.state_hash(), original.state_hash());
  EXPECT_EQ(copy.save(), saved);
  EXPECT_TRUE(same_samples(copy, original));
  constexpr int kTicks = repetitions(1'000'000);
  for (int i = 0; i < kTicks; ++i) {
    drive(original);
    drive(copy);
    if (i < 10'000 || i % 1000 == 0) {
      ASSERT_TRUE(same_samples(copy, original)) << "tick " << copy.tick();
    }
  }
  EXPECT_EQ(copy.tick(), kTicks + 2600);
  EXPECT_EQ(copy.state_hash(), original.state_hash());
  EXPECT_EQ(copy.sample(0).faults & kDiverged, 0u);
}

// Catches: a latched fault, a held command or a half-spent watchdog that a restore forgets.
TEST(BenchState, DET_05_SilenceAndFaultsAreRestoredToo) {
  BenchSetup setup = servo_setup(1);
  setup.watchdog_ticks = 10;
  setup.lease_ticks = 40;
  for (const int silent : {0, 1, 5, 9, 10, 20, 39, 50}) {
    Bench original(setup);
    submit_lease(original, LeaseAction::kAcquire, kOwner);
    submit_volts(original, kOwner, 5.0);
    step(original, 1 + silent);
    Bench copy(setup);
    ASSERT_TRUE(copy.restore(original.save()));
    for (int i = 0; i < 60; ++i) {
      original.step();
      copy.step();
      ASSERT_TRUE(same_samples(copy, original)) << silent << " + " << i;
    }
    EXPECT_EQ(copy.state_hash(), original.state_hash());
  }
}

struct Grown {
  std::uint64_t first[5] = {1, 2, 3, 4, 5};
  double later[2] = {};
  double last[1] = {};
};

}  // namespace
template <>
inline constexpr auto kLaterWords<Grown> =
    std::array{WordRange{.first = 5, .count = 2}, WordRange{.first = 7, .count = 1}};
namespace {

// Recordings hold hashes of earlier builds. Catches: words that a later build has added and that change the
// hash of a bench that does not use them; used ones that it does not see; the same for values of parameters.
TEST(BenchState, WordsOfLaterBuildsAreHashedWhereTheyAreUsed) {
  const auto digest_of = [](const auto& block) {
    Digest digest;
    digest.add(7);
    digest.add_block(block);
    return digest.value();
  };
  struct {
    std::uint64_t first[5] = {1, 2, 3, 4, 5};
  } before;
  Grown grown;
  EXPECT_EQ(digest_of(grown), digest_of(before));
  grown.later[1] = 5e-324;
  EXPECT_NE(digest_of(grown), digest_of(before));
  // Words that a build after that has added: where they are not used the hash is that of the build between.
  struct {
    std::uint64_t first[5] = {1, 2, 3, 4, 5};
    double later[2] = {0.0, 5e-324};
  } between;
  EXPECT_EQ(digest_of(grown), digest_of(between));
  grown.last[0] = 1.0;
  EXPECT_NE(digest_of(grown), digest_of(between));
  EXPECT_EQ(kLaterWords<Sample>.front().first, 49u);
  EXPECT_EQ(kLaterWords<Sample>.back().first + kLaterWords<Sample>.back().count, sizeof(Sample) / 8);

  BenchSetup setup = servo_setup();
  const std::uint64_t as_before = Bench(setup).state_hash();
  int later = 0;
  for (const Parameter& row : axis_parameters(servo_axis())) {
    if (!row.later) continue;
    ++later;
    EXPECT_EQ(row.get(servo_axis()), 0.0) << row.name;
    BenchSetup used = setup;
    row.set(used.axes[0].parameters, 1.0);
    EXPECT_NE(Bench(used).state_hash(), as_before) << row.name;
  }
  EXPECT_GE(later, 2);
}

// One bit of every byte, and every kind of wrong length. Catches: a part of the state that the digest does
// not cover, a restore that has already begun when it notices.
TEST(BenchState, DamagedBytesAreRefusedAndChangeNothing) {
  Bench original(rich_setup());
  run_to(original, 300);
  std::vector<std::byte> saved = original.save();
  Bench other(rich_setup());
  run_to(other, 50);
  const std::uint64_t before = other.state_hash();
  for (std::size_t i = 0; i < saved.size(); i += i % 61 == 0 ? 1 : 5) {
    const auto flip = std::byte{1} << static_cast<int>(i % 8);
    saved[i] ^= flip;
    ASSERT_FALSE(other.restore(saved)) << "byte " << i;
    saved[i] ^= flip;
  }
  EXPECT_FALSE(other.restore({}));
  EXPECT_FALSE(other.restore(std::span(saved).first(saved.size() - 8)));
  EXPECT_FALSE(other.restore(std::span(saved).first(saved.size() - 1)));
  saved.push_back(std::byte{});
  EXPECT_FALSE(other.restore(saved));
  EXPECT_EQ(other.state_hash(), before);
  saved.pop_back();
  EXPECT_TRUE(other.restore(saved));
}

/// The bytes with other words and the digest that fits them: what a client can send that knows the format.
std::vector<std::byte> forged(std::vector<std::byte> saved, std::size_t word, std::uint64_t value) {
  std::memcpy(saved.data() + 8 * word, &value, 8);
  Digest digest;
  for (std::size_t at = 0; at + 8 < saved.size(); at += 8) {
    std::uint64_t each = 0;
    std::memcpy(&each, saved.data() + at, 8);
    digest.add(each);
  }
  const std::uint64_t sum = digest.value();
  std::memcpy(saved.data() + saved.size() - 8, &sum, 8);
  return saved;
}

// Every word becomes a number that no bench comes to, with a digest that fits. Catches: a state from a client
// that harms the bench, or that restore() takes for another one than it is; run with the sanitizers, too.
TEST(BenchState, AForgedStateIsRefusedOrRuns) {
  Bench original(rich_setup());
  run_to(original, 300);
  const std::vector<std::byte> saved = original.save();
  ASSERT_TRUE(Bench(rich_setup()).restore(forged(saved, 0, 0x3474'6174'7362'7264u)));
  const std::array values{std::bit_cast<std::uint64_t>(std::nan("")), std::bit_cast<std::uint64_t>(1e300),
                          std::uint64_t{255}, std::uint64_t{1} << 62};
  int taken = 0;
  for (std::size_t n = 0; n < values.size(); ++n) {
    const std::uint64_t value = values[n];
    const std::size_t schedule_end = Bench::kMaxScheduled * sizeof(PackedInput) / 8;
    for (std::size_t word = 0; word + 1 < saved.size() / 8; word += word + 13 < schedule_end ? 13 : 1) {
      if (kSanitized && (word + n) % values.size() != 0) continue;  // one of the values for each word
      const std::vector<std::byte> bytes = forged(saved, word, value);
      Bench bench(rich_setup());
      const std::uint64_t before = bench.state_hash();
      if (!bench.restore(bytes)) {
        ASSERT_EQ(bench.state_hash(), before) << word;
        continue;
      }
      ++taken;
      ASSERT_EQ(bench.save(), bytes) << word;
      bench.step();
      bench.step();
      // A finite number that is far too large ends as a diverged axis, which stands still and says so.
      if (!std::isnan(std::bit_cast<double>(value))) continue;
      for (std::size_t axis = 0; axis < 2; ++axis)
        ASSERT_EQ(bench.sample(axis).faults & kDiverged, 0u) << word;
    }
  }
  EXPECT_GT(taken, kSanitized ? 25 : 100);  // counters of samples, for example, can be anything
}

// Catches: an axis that another session holds given to the owner that the state names, a lease that ends with
// a restore, inputs of the controller that are lost, or a run that goes on otherwise under the same owner.
TEST(BenchState, LeasesStayWithTheirHolders) {
  Bench original(servo_setup());
  submit_lease(original, LeaseAction::kAcquire, kOwner);
  for (int i = 0; i < 10; ++i) {
    submit_volts(original, kOwner, 5.0);
    original.step();
  }
  const Tick later = original.tick() + 5;
  original.submit(
      {.tick = later, .axis = 0, .owner = kOwner, .action = fault_of("current_sensor_gain", 0.1)});
  const std::vector<std::byte> driven = original.save();
  const std::vector<std::byte> start = Bench(servo_setup()).save();

  for (const Owner holder : {kOwner, Owner{8}}) {
    Bench other(servo_setup());
    submit_lease(other, LeaseAction::kAcquire, holder);
    ASSERT_TRUE(other.restore_for_holders(driven));
    EXPECT_EQ(other.owner(0), holder);
    EXPECT_EQ(other.sample(0).owner, holder);
    EXPECT_EQ(other.state_hash() == original.state_hash(), holder == kOwner);
    while (other.tick() < later) {
      submit_volts(other, holder, 5.0);
      other.step();
    }
    EXPECT_EQ(other.sample(0).faults & kLatchedFaults, 0u);
    other.step();
    EXPECT_NE(other.sample(0).injected, 0u);
    EXPECT_EQ(other.sample(0).refused_commands, 0u);
    ASSERT_TRUE(other.restore_for_holders(start));
    EXPECT_EQ(other.owner(0), holder);
    EXPECT_EQ(other.tick(), 0);
  }

  Bench alone(servo_setup());
  ASSERT_TRUE(alone.restore_for_holders(driven));
  EXPECT_EQ(alone.owner(0), 0u);
  alone.step();
  EXPECT_EQ(alone.sample(0).faults & kLatchedFaults, std::uint64_t{kLeaseLost});
}

// Catches: a state that is taken for that of a bench with another motor, timing or seed.
TEST(BenchState, AStateOfAnotherSetupIsRefused) {
  Bench original(rich_setup());
  run_to(original, 300);
  const std::vector<std::byte> saved = original.save();
  std::vector<BenchSetup> others(12, rich_setup());
  others[0].period_ns = 100'000;
  others[1].substeps = 4;
  others[2].seed = 2;
  others[3].command_delay_ticks = 0;
  others[4].watchdog_ticks = 21;
  others[5].lease_ticks = 15'999;
  others[6].axes[1].on_link_loss = SafeAction::kFreewheel;
  induction(others[7].axes[0].parameters).rotor_resistance_ohm = 3.91;
  others[8].axes.push_back(others[8].axes[0]);
  others[9].axes[1].shares_shaft_with = 0;
  others[10].axes[0].parameters.mechanics.load_profile = Curve({{0.0, 0.0}, {1.0, 0.1}});
  others[11].axes[0].parameters.machine = BldcMachineParameters{.pole_pairs = 3,
                                                                .stator_resistance_ohm = 1.7,
                                                                .self_inductance_h = 0.014,
                                                                .mutual_inductance_h = 0.0,
                                                                .torque_constant_nm_per_a = 0.1};
  for (const BenchSetup& setup : others) {
    Bench bench(setup);
    const std::uint64_t before = bench.state_hash();
    EXPECT_FALSE(bench.restore(saved));
    EXPECT_EQ(bench.state_hash(), before);
  }
}

// Catches: anything random, uninitialised or dependent on an address in a run; a hash that forgets the past.
TEST(BenchState, TheSameInputsGiveTheSameHashAndOneChangedBitAnotherHash) {
  const std::uint64_t hash = hash_at(rich_setup(), 3000);
  EXPECT_EQ(hash_at(rich_setup(), 3000), hash);
  EXPECT_NE(hash_at(rich_setup(), 2999), hash);
  const double one_bit = std::nextafter(30.0, 31.0) - 30.0;
  EXPECT_NE(hash_at(rich_setup(), 3000, one_bit), hash);
}

// An input that came and left no trace in the present state is still in the samples so far. Catches: a hash
// of the present state only.
TEST(BenchState, TheHashCoversEarlierSamples) {
  Bench a(servo_setup());
  Bench b(servo_setup());
  b.submit({.tick = 2, .axis = 0, .owner = 0, .action = LoadChange{0.0, 3}});
  b.submit({.tick = 2, .axis = 0, .owner = 0, .action = LoadChange{0.0, 0}});
  b.submit({.tick = 2, .axis = 0, .owner = 0, .action = RefusedCommand{}});
  step(a, 10);
  step(b, 10);
  EXPECT_NE(a.state_hash(), b.state_hash());
  Bench scheduled(servo_setup());
  scheduled.submit({.tick = 100, .axis = 0, .owner = 0, .action = LoadChange{0.1, 0}});
  step(scheduled, 10);
  EXPECT_NE(a.state_hash(), scheduled.state_hash());
}

// Catches: noise that is on where it is not asked for, and a seed that does not reach it.
TEST(BenchState, TheSeedMattersOnlyWhereThereIsNoise) {
  for (const bool noise : {false, true}) {
    BenchSetup setup = rich_setup();
    setup.axes[0].parameters.sensors.current.noise_rms_a = noise ? 0.02 : 0.0;
    BenchSetup reseeded = setup;
    reseeded.seed = 12'345;
    EXPECT_EQ(hash_at(setup, 500) == hash_at(reseeded, 500), !noise);
  }
}

// Catches: a digest that is blind to order, to zeros, to a lane or to the length.
TEST(Digest, EveryBitAndTheOrderCount) {
  const auto digest_of = [](const std::vector<std::uint64_t>& words) {
    Digest digest;
    for (const std::uint64_t word : words)
      digest.add(word);
    return digest.value();
  };
  const std::vector<std::uint64_t> words{1, 2, 3, 4, 5, 6, 7, 8, 9};
  const std::uint64_t value = digest_of(words);
  for (std::size_t i = 0; i < words.size(); ++i) {
    for (unsigned bit = 0; bit < 64; ++bit) {
      std::vector<std::uint64_t> flipped = words;
      flipped[i] ^= std::uint64_t{1} << bit;
      ASSERT_NE(digest_of(flipped), value);
    }
    for (std::size_t k = 0; k < i; ++k) {
      std::vector<std::uint64_t> swapped = words;
      std::swap(swapped[i], swapped[k]);
      ASSERT_NE(digest_of(swapped), value) << i << " " << k;
    }
  }
  EXPECT_NE(digest_of({}), digest_of({0}));
  EXPECT_NE(digest_of({0}), digest_of({0, 0}));
}

}  // namespace
}  // namespace drivebench
