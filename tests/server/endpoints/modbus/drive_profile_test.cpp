// The state machine behind the control word.
#include "plant/faults.hpp"
#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::drive_profile_test {
namespace {

// Catches: transitions of CiA 402 that are missing or too many; a motor that starts on a control word left
// over.
TEST(Modbus, TheControlWordWalksThroughTheStates) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  constexpr std::uint16_t kStateBits = 0x6f;
  const auto state = [&] { return client.read_one(104) & kStateBits; };
  const auto control = [&](std::uint16_t word) {
    EXPECT_EQ(client.write(101, {word, 1000, static_cast<std::uint16_t>(-500)}), 0) << word;
    return state();
  };
  EXPECT_EQ(state(), 0x40) << "switch on disabled";
  EXPECT_EQ(control(0x0f), 0x40) << "nothing starts without a shutdown first";
  EXPECT_EQ(control(0x06), 0x21) << "ready to switch on";
  EXPECT_EQ(control(0x07), 0x23) << "switched on";
  EXPECT_EQ(bench.newest().u_a_v, 0.0);
  EXPECT_EQ(control(0x0f), 0x27) << "operation enabled";
  EXPECT_EQ(bench.newest().u_a_v, 10.0);
  EXPECT_EQ(bench.newest().u_b_v, -5.0);
  EXPECT_EQ(client.read(101, 3), (Words{0x0f, 1000, static_cast<std::uint16_t>(-500)}));
  EXPECT_EQ(client.write(102, {2000}), 0) << "a reference alone is a command as well";
  EXPECT_EQ(bench.newest().u_a_v, 20.0);
  EXPECT_EQ(control(0x0b), 0x07) << "quick stop";
  EXPECT_EQ(bench.newest().u_a_v, 0.0);
  EXPECT_EQ(control(0x0f), 0x27);
  EXPECT_EQ(control(0x07), 0x23) << "disable operation";
  EXPECT_EQ(control(0x00), 0x40) << "disable voltage";
  EXPECT_EQ(control(0x06), 0x21);
  EXPECT_EQ(control(0x0f), 0x27) << "both steps at once";
  EXPECT_EQ(bench.newest().tick, 11u) << "every write was one tick";
  EXPECT_EQ(client.read_one(104) & 0x0200, 0x0200) << "remote";
}

// Catches: a second write within a tick of real time that is refused, and its state change lost.
TEST(Modbus, ControlWordsBackToBackAreAllCarriedOut) {
  BenchConfig config = modbus_bench_config();
  config.mode = RunMode::kRealtime;
  config.setup.command_delay_ticks = 1;
  config.setup.watchdog_ticks = 1'000'000;
  config.setup.lease_ticks = 60'000'000'000 / config.setup.period_ns;
  config.realtime.max_lateness_ns = 60'000'000'000;
  ModbusBench bench(config);
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const std::vector<std::pair<std::uint16_t, int>> steps{
      {0x06, 0x21}, {0x07, 0x23}, {0x0f, 0x27}, {0x00, 0x40}};
  constexpr int kRounds = 20;
  Bytes stream;
  for (std::size_t i = 0; i < kRounds * steps.size(); ++i) {
    for (const Bytes& pdu : {read_write_pdu(104, 1, 101, {steps[i % steps.size()].first, 100, 0}),
                             write_pdu(102, {200}), pdu_of(3, {104, 1})}) {
      const Bytes adu = adu_of(static_cast<std::uint16_t>(i), 1, pdu);
      stream.insert(stream.end(), adu.begin(), adu.end());
    }
  }
  client.send(stream);
  for (std::size_t i = 0; i < kRounds * steps.size(); ++i) {
    const auto [word, state] = steps[i % steps.size()];
    // Read in one transaction, after a reference that came alone, and by itself.
    const Bytes exchanged = client.receive_adu();
    const Bytes written = client.receive_adu();
    const Bytes read = client.receive_adu();
    ASSERT_EQ(exchanged.size(), 11u) << i << ": exception " << int{exchanged.back()};
    EXPECT_EQ(exchanged.back() & 0x6f, state) << i;
    EXPECT_EQ(written[7], 16) << i << ": exception " << int{written.back()};
    ASSERT_EQ(read.size(), 11u);
    EXPECT_EQ(read.back() & 0x6f, state) << i;
  }
  EXPECT_EQ(bench.count("refused_writes"), 0u);
  EXPECT_GE(bench.newest().tick, 2 * kRounds * steps.size() - 1) << "a tick for each";
}

// Catches: a fault that a level instead of an edge resets, or that a write of other registers resets.
TEST(Modbus, AFaultIsResetByTheRisingBit) {
  ModbusBench bench(tripping_bench_config());
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const auto faulted = [&] { return (client.read_one(104) & 0x4f) == 0x08; };
  client.write(101, {0x06, 0, 0});
  client.write(101, {0x8f, 8000, 0});  // with the bit set while there is nothing to reset
  for (int i = 0; i < 50 && !faulted(); ++i)
    client.write(102, {8000});
  ASSERT_TRUE(faulted());
  EXPECT_EQ(client.read_one(110) & kOverCurrentTrip, kOverCurrentTrip);
  EXPECT_EQ(client.ask(pdu_of(2, {8, 1})), (Bytes{2, 1, 1})) << "as a discrete input as well";
  EXPECT_EQ(client.write(101, {0x8f}), 0) << "in fault it is gates off, and there is no edge";
  EXPECT_EQ(client.ask(pdu_of(2, {20, 1})), (Bytes{2, 1, 1})) << "state fault";
  EXPECT_TRUE(faulted());
  for (int i = 0; i < 400; ++i)  // until the current has decayed
    client.write(101, {0x00});
  EXPECT_EQ(client.write(101, {0x80}), 0);
  EXPECT_EQ(client.read_one(104) & 0x4f, 0x40) << "switch on disabled";
  EXPECT_EQ(client.write(101, {0x86}), 0) << "the bit stays set: no second edge, no harm";
  EXPECT_EQ(client.read_one(104) & 0x6f, 0x21);
}

// Catches: faults that are cleared by a write whose answer says that nothing was done.
TEST(Modbus, ALateFaultResetClearsNothing) {
  BenchConfig config = modbus_bench_config(2);
  config.setup.axes[0].parameters.drive.amplifier.over_current_a = 0.01;
  config.setup.axes[0].parameters.drive.amplifier.over_current_trip = true;
  ModbusBench bench(config);
  Client client(bench.port());
  Client other(bench.port());
  ASSERT_EQ(client.write(400, {7}, 1), 0);
  std::uint32_t tick = 0;
  while (tick < 50 && (bench.newest().faults & kOverCurrentTrip) == 0)
    ASSERT_FALSE(client.exchange(1, tick++, 80.0f, 0.0f).empty());
  for (int i = 0; i < 400; ++i)  // until the current has decayed
    ASSERT_FALSE(client.exchange(0, tick++, 0.0f, 0.0f).empty());
  ASSERT_NE(bench.newest().faults & kLatchedFaults, 0u);
  ASSERT_EQ(other.write(400, {8}, 2), 0);  // nothing runs without this one
  ASSERT_EQ(client.write(101, {0x00}), 0) << "answers the tick";
  EXPECT_EQ(client.write(101, {0x80}), 6);
  EXPECT_EQ(client.read_one(410), 6) << "this tick has its command";
  EXPECT_FALSE(other.exchange(1, tick, 0.0f, 0.0f, 2).empty());
  EXPECT_NE(bench.newest().faults & kLatchedFaults, 0u);
  EXPECT_EQ(client.write(101, {0x80}), 0) << "the edge was not used up";
  EXPECT_FALSE(other.exchange(1, tick + 1, 0.0f, 0.0f, 2).empty());
  EXPECT_EQ(bench.newest().faults & kLatchedFaults, 0u);
}

// Catches: a control word written during a fault that leaves the drive in it after the fault is gone.
TEST(Modbus, AFaultClearedByRegisterEndsTheStateFault) {
  BenchConfig config = modbus_bench_config();
  config.setup.lease_ticks = 50'000'000 / config.setup.period_ns;
  ModbusBench bench(config);
  {
    Client lost(bench.port());
    ASSERT_EQ(lost.write(400, {7}), 0);
    ASSERT_FALSE(lost.exchange(1, 0, 5.0f, 0.0f).empty());
  }
  bench.until([&] { return bench.owner() == 0; });
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const auto state = [&] { return client.read_one(104) & 0x6f; };
  ASSERT_EQ(client.write(101, {0x06, 0, 0}), 0);
  ASSERT_EQ(state(), 0x08) << "the lost lease is latched";
  ASSERT_EQ(client.write(401, {1}), 0);
  ASSERT_EQ(client.write(101, {0x06, 0, 0}), 0) << "the newest sample still has the fault";
  ASSERT_EQ(client.write(101, {0x06, 0, 0}), 0);
  EXPECT_EQ(state(), 0x21) << "ready to switch on";
}

}  // namespace
}  // namespace drivebench::modbus::drive_profile_test
