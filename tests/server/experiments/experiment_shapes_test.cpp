// The inputs of experiments, against closed forms.
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <numeric>

#include "server/experiments/shapes.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::experiment_shapes_test {
namespace {

constexpr double kPeriodS = 1e-3;
constexpr double kPi = 3.14159265358979323846;

// Products and sums of some ten roundings at magnitudes around 10.
constexpr double kRounding = 1e-12;

double at(const InputShape& shape, Tick tick, Connection connection = Connection::kStar) {
  InputValues values{};
  add_shape(shape, tick, kPeriodS, connection, values);
  return values[0];
}

template <class Shape>
InputShape on_a(const Shape& shape, Tick start = 0, Tick end = 1000) {
  return {.channel = InputChannel::kA, .start = start, .end = end, .shape = shape};
}

// Catches: a start that is off by a tick, an end that is included, a constant that outlives its end.
TEST(ExperimentShapes, ConstantIsAStepFromItsStartToBeforeItsEnd) {
  const InputShape shape = on_a(ConstantShape{2.5}, 10, 20);
  EXPECT_EQ(at(shape, 9), 0.0);
  EXPECT_EQ(at(shape, 10), 2.5);
  EXPECT_EQ(at(shape, 19), 2.5);
  EXPECT_EQ(at(shape, 20), 0.0);
}

// Catches: a ramp that is zero outside of its ends, or a slope that forgets where it begins.
TEST(ExperimentShapes, RampIsAStraightLineThatHoldsItsEnds) {
  const InputShape shape = on_a(RampShape{.from = 1.0, .to = 6.0}, 100, 120);
  EXPECT_EQ(at(shape, 0), 1.0);
  EXPECT_EQ(at(shape, 100), 1.0);
  EXPECT_NEAR(at(shape, 104), 2.0, kRounding);
  EXPECT_EQ(at(shape, 120), 6.0);
  EXPECT_EQ(at(shape, 5000), 6.0);
}

// Catches: a phase that counts from tick 0 instead of the start, degrees, a lost offset, and an angle that
// loses its digits in a long run.
TEST(ExperimentShapes, SineCountsTimeFromItsStart) {
  const InputShape shape =
      on_a(SineShape{.amplitude = 2.5, .frequency_hz = 10.0, .phase_rad = 0.3, .offset = 0.5}, 50, 4'000'000);
  for (const Tick tick : {50, 63, 777}) {
    const double tau_s = static_cast<double>(tick - 50) * kPeriodS;
    EXPECT_NEAR(at(shape, tick), 0.5 + 2.5 * std::sin(2.0 * kPi * 10.0 * tau_s + 0.3), kRounding);
  }
  // 10 Hz repeats every 100 ticks; 3e5 rad in double leave 6e-11 of a time of 3500 s times 10 Hz.
  EXPECT_NEAR(at(shape, 50 + 3'500'025), at(shape, 50 + 25), 1e-9);
}

// Catches: phases that follow each other the wrong way round, 120 degrees in a two-phase machine, a rise that
// does not end.
TEST(ExperimentShapes, ThreePhasesLagBehindEachOther) {
  const InputShape shape{
      .channel = InputChannel::kPhases,
      .start = 0,
      .end = 1000,
      .shape = ThreePhaseShape{.amplitude = 10.0, .frequency_hz = 50.0, .phase_rad = 0.2, .rise_s = 0.02}};
  const auto values_at = [&shape](Tick tick, Connection connection) {
    InputValues values{};
    add_shape(shape, tick, kPeriodS, connection, values);
    return values;
  };
  for (const Tick tick : {0, 7, 20, 33}) {
    const double t = static_cast<double>(tick) * kPeriodS;
    const double angle = 2.0 * kPi * 50.0 * t + 0.2;
    const double size = 10.0 * std::min(t / 0.02, 1.0);
    const InputValues star = values_at(tick, Connection::kStar);
    EXPECT_NEAR(star[0], size * std::cos(angle), kRounding);
    EXPECT_NEAR(star[1], size * std::cos(angle - 2.0 * kPi / 3.0), kRounding);
    EXPECT_NEAR(star[2], size * std::cos(angle + 2.0 * kPi / 3.0), kRounding);
    const InputValues two = values_at(tick, Connection::kTwoPhase);
    EXPECT_NEAR(two[1], size * std::sin(angle), kRounding);
    EXPECT_EQ(two[2], 0.0);
  }
}

// Catches: the classic chirp mistake, f(t) t instead of the integral of f, which ends at twice the frequency.
TEST(ExperimentShapes, ChirpIsTheSineOfTheIntegralOfItsFrequency) {
  const InputShape shape = on_a(ChirpShape{.amplitude = 3.0, .from_hz = 5.0, .to_hz = 45.0}, 0, 1000);
  for (const Tick tick : {1, 250, 999}) {
    const double t = static_cast<double>(tick) * kPeriodS;
    EXPECT_NEAR(at(shape, tick), 3.0 * std::sin(2.0 * kPi * (5.0 * t + 20.0 * t * t)), kRounding);
  }
}

// Catches: taps of which the register runs in a shorter circle (for every order), an unbalanced sequence, and
// one that is not white.
TEST(ExperimentShapes, PrbsHasMaximumLength) {
  for (std::uint32_t order = kMinPrbsOrder; order <= kMaxPrbsOrder; ++order) {
    const std::vector<bool>& bits = maximum_length_sequence(order);
    ASSERT_EQ(bits.size(), (std::size_t{1} << order) - 1);
    EXPECT_EQ(std::accumulate(bits.begin(), bits.end(), std::size_t{0}), std::size_t{1} << (order - 1));
    // The autocorrelation of a maximum-length sequence is -1 for every shift but 0.
    for (const std::size_t shift : {std::size_t{1}, bits.size() / 7, bits.size() / 3}) {
      std::int64_t sum = 0;
      for (std::size_t i = 0; shift > 0 && i < bits.size(); ++i)
        sum += bits[i] == bits[(i + shift) % bits.size()] ? 1 : -1;
      EXPECT_EQ(sum, -1) << order << " bits, shift " << shift;
    }
  }
}

// Catches: other bits than those of existing recordings: other taps, another first register.
TEST(ExperimentShapes, PrbsKeepsTheBitsOfExistingRecordings) {
  constexpr auto kHashes =
      std::to_array<std::uint32_t>({0x4736DB29, 0x0E602A71, 0xBD65B135, 0x0B151A79, 0xDC55ACE9, 0x66250AD9,
                                    0x669BCFED, 0xBF706629, 0xC35530C5, 0x34DD7B91, 0xA5AF58D5, 0x89961A91,
                                    0xFEA336D1, 0x9DC3F08D, 0x9E5404B1, 0xBBCC83B1, 0x6C84A22D, 0x645D8311});
  for (std::uint32_t order = kMinPrbsOrder; order <= kMaxPrbsOrder; ++order) {
    std::uint32_t hash = 2166136261u;  // FNV-1a over the bits
    for (const bool bit : maximum_length_sequence(order))
      hash = (hash ^ (bit ? 1u : 0u)) * 16777619u;
    EXPECT_EQ(hash, kHashes[order - kMinPrbsOrder]) << order;
  }
  const std::vector<bool> three_bits = {true, false, true, true, true, false, false};
  EXPECT_EQ(maximum_length_sequence(3), three_bits);
}

// Catches: bits that last a tick whatever bit_ticks says, a seed that changes nothing.
TEST(ExperimentShapes, PrbsHoldsItsBitsAndBeginsAtItsSeed) {
  const std::vector<bool>& bits = maximum_length_sequence(5);
  const InputShape shape =
      on_a(PrbsShape{.amplitude = 4.0, .bit_ticks = 3, .first_bit = 2, .bits = &bits}, 6, 1000);
  for (Tick tick = 6; tick < 200; ++tick) {
    const std::size_t bit = (2 + static_cast<std::size_t>(tick - 6) / 3) % 31;
    EXPECT_EQ(at(shape, tick), bits[bit] ? 4.0 : -4.0) << tick;
  }
}

// Catches: phases that add up all cosines at the start, which Schroeder's phases prevent, or a harmonic that
// is left out.
TEST(ExperimentShapes, MultisineHasItsHarmonicsAndALowPeak) {
  std::vector<std::uint32_t> harmonics(16);
  std::iota(harmonics.begin(), harmonics.end(), 1u);
  const InputShape shape =
      on_a(MultisineShape{.amplitude = 1.0, .base_hz = 1.0, .harmonics = harmonics}, 0, 1000);
  double power = 0.0;
  double peak = 0.0;
  for (Tick tick = 0; tick < 1000; ++tick) {
    power += at(shape, tick) * at(shape, tick) / 1000.0;
    peak = std::max(peak, std::abs(at(shape, tick)));
  }
  EXPECT_NEAR(power, 16 * 0.5, 1e-9);  // orthogonal over whole periods: each has half its amplitude squared
  EXPECT_LT(peak, 2.0 * std::sqrt(power));  // all in phase: 16, or 5.7 times the rms value
}

// Catches: a value before the first row, the next row's value too early, an interpolation past the last row.
TEST(ExperimentShapes, TableHoldsOrJoinsItsRows) {
  const std::vector<SignalTable::Row> rows = {{0.010, 1.0}, {0.020, 3.0}, {0.040, -1.0}};
  const auto view = std::make_shared<const TableView>(std::span(rows));
  const InputShape held = on_a(TableShape{.table = view, .interpolate = false}, 100, 1000);
  EXPECT_EQ(at(held, 109), 0.0);
  EXPECT_EQ(at(held, 110), 1.0);
  EXPECT_EQ(at(held, 119), 1.0);
  EXPECT_EQ(at(held, 139), 3.0);
  EXPECT_EQ(at(held, 900), -1.0);
  const InputShape joined = on_a(TableShape{.table = view, .interpolate = true}, 100, 1000);
  EXPECT_NEAR(at(joined, 115), 2.0, kRounding);
  EXPECT_NEAR(at(joined, 130), 1.0, kRounding);
  EXPECT_EQ(at(joined, 900), -1.0);
}

// Catches: a shape that replaces the value of another one.
TEST(ExperimentShapes, ShapesAdd) {
  InputValues values{};
  add_shape(on_a(ConstantShape{2.0}), 5, kPeriodS, Connection::kArmature, values);
  add_shape(on_a(ConstantShape{-0.5}), 5, kPeriodS, Connection::kArmature, values);
  EXPECT_EQ(values[0], 1.5);
}

// Catches: a table whose second part overwrites its first, or that shows rows before they are written.
TEST(ExperimentShapes, TablesOnDiskReadBackTheAppendedRows) {
  const TestFolder folder;
  SignalTable table(folder / "1.table");
  const std::vector<SignalTable::Row> first = {{0.0, 1.0}, {1.0, 2.0}};
  const std::vector<SignalTable::Row> second = {{2.0, 3.0}};
  table.append(first);
  table.append(second);
  EXPECT_EQ(table.size(), 3u);
  EXPECT_EQ(table.last_time_s(), 2.0);
  const TableView view(table);
  EXPECT_EQ(view.at(0.5, false), 1.0);
  EXPECT_EQ(view.at(1.5, true), 2.5);
  EXPECT_EQ(view.at(9.0, false), 3.0);
}

std::size_t resident_bytes() {
  std::size_t all = 0;
  std::size_t resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

// Catches: a mapped table that is read whole while the I/O thread of a server with locked memory waits.
TEST(ExperimentShapes, AMappedTableIsReadWhereItIsNeeded) {
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_MEMLOCK, &limit), 0);
  if (limit.rlim_cur != RLIM_INFINITY && ::geteuid() != 0) GTEST_SKIP() << "memory cannot be locked here";
  std::vector<SignalTable::Row> rows(std::size_t{1} << 20);  // 16 MiB
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i] = {.time_s = static_cast<double>(i), .value = static_cast<double>(i % 7)};
  const TestFolder folder;
  SignalTable table(folder / "1.table");
  table.append(rows);
  if (::mlockall(MCL_FUTURE) != 0) GTEST_SKIP() << "memory cannot be locked: " << std::strerror(errno);
  const std::size_t before = resident_bytes();
  const TableView view(table);
  const std::size_t after = resident_bytes();
  ::munlockall();
  EXPECT_LT(after, before + (std::size_t{1} << 20));
  EXPECT_EQ(view.at(1e6, false), static_cast<double>(1'000'000 % 7));
}

}  // namespace
}  // namespace drivebench::experiment_shapes_test
