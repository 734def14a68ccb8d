// Leases, commands and exchanges: MB-11, MB-13 and MB-15 of the list of faults.
#include <cmath>

#include "plant/faults.hpp"
#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::lease_test {
namespace {

constexpr Owner kTcpSession = 1'000'000;

Input lease_input(LeaseAction action, std::uint32_t axis = 0) {
  return {.tick = 0, .axis = axis, .owner = kTcpSession, .action = action};
}

/// A bench whose lease lasts this long.
BenchConfig with_lease(std::int64_t lease_ms, RunMode mode = RunMode::kLockstep) {
  BenchConfig config = modbus_bench_config();
  config.mode = mode;
  if (mode == RunMode::kRealtime) config.setup.command_delay_ticks = 1;
  config.setup.lease_ticks = lease_ms * 1'000'000 / config.setup.period_ns;
  return config;
}

enum LeaseStatus : std::uint16_t { kNobody = 0, kMine = 1, kAnotherConnection = 2, kAnotherTransport = 3 };
std::uint16_t lease_status(Client& client) {
  return client.read_one(409);
}

// Catches: a second axis on an amplifier that can be leased, commanded or cleared, an answer that gives
// another reason, a tick that waits for it.
TEST(Modbus, MB_13_AnAxisOnAnotherOnesAmplifierRefusesByACodeOfItsOwn) {
  BenchConfig config = modbus_bench_config(2);
  config.setup.axes[1].shares_amplifier_with = 0;
  ModbusBench bench(config);
  Client client(bench.port());
  constexpr std::uint8_t kSecond = 2;
  constexpr int kFailure = 4;
  ASSERT_EQ(client.write(400, {7}), 0);
  for (const Words& words : {Words{7}, Words{0}}) {
    EXPECT_EQ(client.write(400, words, kSecond), kFailure);
    EXPECT_EQ(client.read_one(410, kSecond), 12) << "shares amplifier";
  }
  EXPECT_EQ(client.write(401, {1}, kSecond), kFailure) << "a clear";
  EXPECT_EQ(client.write(402, command_words(1, 0, 1.0f, 0.0f), kSecond), kFailure);
  EXPECT_EQ(client.read_one(410, kSecond), 12);
  EXPECT_FALSE(client.exchange(1, 0, 1.0f, 0.0f).empty());
  EXPECT_EQ(bench.newest().tick, 1u);
}

// Catches: a block put together from two ticks, a float whose halves belong to different values.
TEST(Modbus, MB_11_ABlockIsOfOneTick) {
  BenchConfig config = modbus_bench_config();
  config.mode = RunMode::kRealtime;
  config.setup.command_delay_ticks = 1;
  config.setup.axes[0].parameters.sensors.current.noise_rms_a = 1.0;  // another current at every tick
  ModbusBench bench(config);
  Client client(bench.port());
  int changes = 0;
  std::uint64_t last = 0;
  for (int i = 0; i < 2000; ++i) {
    const Words sample = client.read(kSampleStart, kSampleLength);
    ASSERT_EQ(sample.size(), kSampleLength);
    const std::uint64_t first_tick = get(Type::kUnsigned64, WordOrder::kAbcd, &sample[0]);
    EXPECT_EQ(get(Type::kUnsigned64, WordOrder::kAbcd, &sample[kSampleLength - 4]), first_tick);
    changes += first_tick != last ? 1 : 0;
    last = first_tick;
    const Words process = client.read(kProcessStart, 13);
    ASSERT_EQ(process.size(), 13u);
    EXPECT_EQ(process[0], process[12]);
  }
  EXPECT_GT(changes, 10) << "the bench was running";
}

// Catches: a sample block whose order, types or words differ from the catalogue; a mirror with other values.
TEST(Modbus, MB_11_TheSampleBlockIsTheSample) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  Words words;
  for (std::uint32_t tick = 0; tick < 200; ++tick)
    words = client.exchange(1, tick, 20.0f, -7.5f);
  const Sample expected = bench.newest();
  ASSERT_EQ(words.size(), kSampleLength);
  constexpr std::size_t kWhole = map_detail::kMoreSample.back().end() - kSampleStart;
  const Sample got = read_sample(client.read_all(kSampleStart, kWhole));
  EXPECT_EQ(client.read_all(kSampleStart + kWhole - 4, 4), client.read_all(kSampleStart, 4)) << "the tick";
  for (const Signal& signal : kSignals) {
    const double value = value_of(signal, expected);
    EXPECT_EQ(value_of(signal, got),
              signal.type == SignalType::kReal ? static_cast<double>(static_cast<float>(value)) : value)
        << signal.name;
  }
  EXPECT_EQ(client.read(kSampleStart, kSampleLength), words);
  const Words mirror = client.read(kSampleStart + 10'000, kSampleLength);
  EXPECT_EQ(mirror[3], words[0]) << "the tick is the first value: four words, last one first";
  EXPECT_EQ(mirror[0], words[3]);
  const Words process = client.read(kProcessStart, 13);
  EXPECT_EQ(process[5], static_cast<std::uint16_t>(std::lround(expected.speed_rad_s * 10.0)));
  EXPECT_EQ(process[6], static_cast<std::uint16_t>(std::lround(expected.i_a_a * 100.0)));
  EXPECT_EQ(process[9], 10'000u) << "1000 V";
}

// Catches: a write without the lease that is carried out, is not counted, or is answered as if carried out.
TEST(Modbus, MB_13_WithoutTheLeaseNothingIsWritten) {
  ModbusBench bench;
  Client client(bench.port());
  EXPECT_TRUE(client.exchange(1, 0, 5.0f, 0.0f).empty());
  EXPECT_EQ(client.last_exception(), 6);
  EXPECT_EQ(client.write(101, {6}), 6) << "process data";
  EXPECT_EQ(client.write(401, {1}), 6) << "clear faults";
  EXPECT_EQ(client.write(1002, {0x40a0, 0}), 6) << "a parameter";
  EXPECT_EQ(client.ask(pdu_of(5, {0, 0xff00})), exception_pdu(5, 6));
  EXPECT_EQ(client.read_one(410), 2) << "not the owner";
  EXPECT_EQ(bench.count("refused_writes"), 5u);

  Client owner(bench.port());
  ASSERT_EQ(owner.write(400, {7}), 0);
  EXPECT_EQ(client.write(400, {8}), 6) << "another key";
  Words with_key{8, 0};
  for (const std::uint16_t word : command_words(1, 0, 5.0f, 0.0f))
    with_key.push_back(word);
  EXPECT_EQ(client.write(400, with_key), 6) << "another key with a command";
  EXPECT_TRUE(client.exchange(1, 0, 5.0f, 0.0f).empty());
  EXPECT_EQ(client.last_exception(), 6);
  EXPECT_EQ(lease_status(client), kAnotherConnection);
  EXPECT_EQ(client.read_one(400), 0) << "only the holder reads the key";
  EXPECT_EQ(owner.read_one(400), 7);
  EXPECT_FALSE(owner.exchange(1, 0, 5.0f, 0.0f).empty());
  EXPECT_EQ(bench.newest().refused_commands, 0u) << "no part of the run";
  EXPECT_EQ(bench.count("not_owner"), 8u);
  EXPECT_EQ(bench.newest().u_a_v, 5.0);
}

// Catches: an axis with two owners, one on each transport.
TEST(Modbus, MB_13_ALeaseOfAnotherTransportCounts) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(bench.request(lease_input(LeaseAction::kAcquire)), Refused::kNot);
  EXPECT_EQ(lease_status(client), kAnotherTransport);
  EXPECT_EQ(client.write(400, {7}), 6);
  EXPECT_EQ(client.read_one(410), 3) << "owned by another";
  EXPECT_EQ(bench.owner(), kTcpSession);
  ASSERT_EQ(bench.request(lease_input(LeaseAction::kRelease)), Refused::kNot);
  EXPECT_EQ(client.write(400, {7}), 0);
  EXPECT_EQ(lease_status(client), kMine);
  EXPECT_EQ(bench.request(lease_input(LeaseAction::kAcquire)), Refused::kOwned);
  EXPECT_EQ(client.write(400, {0}), 0);
  EXPECT_EQ(bench.owner(), 0u);
}

// Catches: a register or coil that does not acquire, renew or release.
TEST(Modbus, TheLeaseComesAndGoesByRegisterAndCoil) {
  ModbusBench bench;
  Client client(bench.port());
  for (const Bytes& release : {write_pdu(400, {0}), write_pdu(401, {2}), pdu_of(5, {1, 0}),
                               Bytes{15, 0, 0, 0, 2, 1, 0}, pdu_of(22, {400, 0, 0})}) {
    ASSERT_EQ(client.ask(pdu_of(6, {400, 7}))[0], 6);
    EXPECT_EQ(client.ask(pdu_of(1, {0, 2})), (Bytes{1, 1, 2}));
    EXPECT_EQ(client.write(401, {3}), 0) << "renew";
    EXPECT_EQ(client.ask(pdu_of(5, {1, 0xff00}))[0], 5) << "renew";
    EXPECT_EQ(client.ask(release)[0], release[0]);
    EXPECT_EQ(bench.owner(), 0u);
    EXPECT_EQ(lease_status(client), kNobody);
    EXPECT_EQ(client.ask(pdu_of(1, {0, 2})), (Bytes{1, 1, 0}));
  }
  // A client that opens a connection for every call takes its lease over by the same key.
  {
    Client before(bench.port());
    ASSERT_EQ(before.write(400, {7}), 0);
  }
  const Owner owner = bench.owner();
  EXPECT_EQ(client.write(400, {7}), 0);
  EXPECT_EQ(bench.owner(), owner);
  EXPECT_FALSE(client.exchange(1, 0, 1.0f, 0.0f).empty());
}

// Catches: a lease that ends with its connection, or never; a lease that another key can take meanwhile.
TEST(Modbus, MB_15_TheLeaseOutlivesTheConnectionForALeaseTime) {
  {
    ModbusBench bench(with_lease(60'000));
    {
      Client owner(bench.port());
      ASSERT_EQ(owner.write(400, {7}), 0);
      ASSERT_FALSE(owner.exchange(1, 0, 5.0f, 0.0f).empty());
    }
    bench.until([&] { return bench.count("connections") == 0; });
    Client other(bench.port());
    EXPECT_EQ(lease_status(other), kAnotherConnection);
    EXPECT_EQ(other.write(400, {8}), 6);
    EXPECT_EQ(other.write(400, {7}), 0) << "the same key takes over";
    EXPECT_EQ(lease_status(other), kMine);
  }
  ModbusBench bench(with_lease(50));
  {
    Client owner(bench.port());
    ASSERT_EQ(owner.write(400, {7}), 0);
    ASSERT_FALSE(owner.exchange(1, 0, 5.0f, 0.0f).empty());
  }
  bench.until([&] { return bench.owner() == 0; });
  Client next(bench.port());
  ASSERT_EQ(next.write(400, {8}), 0);
  EXPECT_TRUE(next.exchange(1, 1, 5.0f, 0.0f).empty());
  EXPECT_EQ(next.last_exception(), 4) << "the lost lease is latched";
  EXPECT_EQ(next.read_one(410), 5);
  EXPECT_FALSE(next.exchange(0, 1, 0.0f, 0.0f).empty()) << "gates off is always allowed";
  EXPECT_EQ(bench.newest().faults & kLeaseLost, kLeaseLost);
  EXPECT_EQ(next.write(401, {1}), 0);
  EXPECT_FALSE(next.exchange(1, 2, 5.0f, 0.0f).empty());
  EXPECT_EQ(bench.newest().faults & kLatchedFaults, 0u);
}

// Catches: a bench in lockstep that waits for ever for an owner that is connected but silent.
TEST(Modbus, MB_15_AnOwnerThatFallsSilentLosesItsLease) {
  BenchConfig config = with_lease(60'000);
  config.modbus.idle_timeout_ms = 50;
  ModbusBench bench(config);
  Client owner(bench.port());
  ASSERT_EQ(owner.write(400, {7}), 0);
  bench.until([&] { return bench.owner() == 0; });
  EXPECT_EQ(lease_status(owner), kNobody);
  EXPECT_TRUE(owner.exchange(1, 0, 5.0f, 0.0f).empty());
  EXPECT_EQ(owner.last_exception(), 6);
}

// Catches: an exchange that is answered before its tick, or with the sample of another.
TEST(Modbus, AnExchangeShowsTheTickThatItCaused) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  for (std::uint32_t tick = 0; tick < 100; ++tick) {
    const Words words = client.exchange(1, tick, 10.0f, 0.0f);
    ASSERT_EQ(words.size(), kSampleLength);
    const Sample sample = read_sample(words);
    EXPECT_EQ(sample.tick, tick + 1);
    EXPECT_EQ(sample.command_tick, static_cast<std::int64_t>(tick));
    EXPECT_EQ(sample.u_a_v, 10.0);
  }
  EXPECT_TRUE(client.exchange(1, 99, 10.0f, 0.0f).empty()) << "answered already";
  EXPECT_EQ(client.last_exception(), 4);
  EXPECT_EQ(client.read_one(410), 6);
  EXPECT_TRUE(client.exchange(1, 101, 10.0f, 0.0f).empty()) << "not taken yet";
  // The mirror takes the command with its words the other way round.
  EXPECT_EQ(client.write(10'402, {1, 100, 0, 0, 0x4000, 0, 0}), 0);
  EXPECT_EQ(bench.newest().tick, 101u);
  EXPECT_EQ(bench.newest().u_a_v, 2.0);
}

// Catches: modes with another meaning than the map says.
TEST(Modbus, EveryModeHasItsMeaningInTheMap) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  EXPECT_EQ(read_sample(client.exchange(1, 0, 8.0f, -4.0f)).u_b_v, -4.0);
  const Sample duty = read_sample(client.exchange(3, 1, 0.25f, -0.5f));
  EXPECT_EQ(duty.u_a_v, 250.0) << "a quarter of 1000 V";
  EXPECT_EQ(duty.u_b_v, -500.0);
  EXPECT_EQ(read_sample(client.exchange(2, 2, 8.0f, 8.0f)).u_a_v, 0.0);
  client.exchange(0, 3, 8.0f, 8.0f);
  EXPECT_NE(bench.newest().u_a_v, 8.0);
}

// Catches: an exchange in lockstep that blocks others, never ends, or ends before the other axis has
// answered.
TEST(Modbus, AnExchangeWaitsForTheOtherAxis) {
  ModbusBench bench(modbus_bench_config(2));
  Client first(bench.port());
  Client second(bench.port());
  ASSERT_EQ(first.write(400, {7}, 1), 0);
  ASSERT_EQ(second.write(400, {8}, 2), 0);
  first.send(adu_of(9, 1, read_write_pdu(200, kSampleLength, 402, command_words(1, 0, 3.0f, 0.0f))));
  first.send(adu_of(10, 1, pdu_of(3, {0, 1})));
  EXPECT_EQ(second.read_one(0), kMarker) << "others are served meanwhile";
  EXPECT_EQ(bench.newest().tick, 0u);
  EXPECT_FALSE(second.exchange(1, 0, 1.0f, 0.0f, 2).empty());
  const Bytes answer = first.receive_adu();
  ASSERT_GT(answer.size(), 100u);
  EXPECT_EQ(answer[1], 9);
  EXPECT_EQ(first.receive_adu().at(1), 10) << "the later request is answered later";

  // One connection for both: the first command is written, the second exchanged.
  ASSERT_EQ(second.write(400, {0}, 2), 0);
  ASSERT_EQ(first.write(400, {7}, 2), 0);
  EXPECT_EQ(first.write(402, command_words(1, 1, 3.0f, 0.0f), 1), 0);
  EXPECT_FALSE(first.exchange(1, 1, 3.0f, 0.0f, 2).empty());
  EXPECT_EQ(bench.newest(0).tick, 2u);
}

// Catches: an exchange that waits for ever for a tick of a lease that is gone.
TEST(Modbus, AnExchangeEndsWithItsLease) {
  ModbusBench bench(modbus_bench_config(2));
  ASSERT_EQ(bench.request(lease_input(LeaseAction::kAcquire, 1)), Refused::kNot);  // and never commands
  Client owner(bench.port());
  Client heir(bench.port());
  ASSERT_EQ(owner.write(400, {7}), 0);
  owner.send(adu_of(9, 1, read_write_pdu(200, kSampleLength, 402, command_words(1, 0, 3.0f, 0.0f))));
  bench.until([&] { return bench.count("requests") == 2; });
  ASSERT_EQ(heir.write(400, {7}), 0);
  const Bytes answer = owner.receive_adu();
  EXPECT_EQ(Bytes(answer.begin() + 7, answer.end()), exception_pdu(23, 6));
  EXPECT_EQ(bench.newest().tick, 0u);
}

// Catches: an owner that dies unnoticed while its exchange waits for another axis.
TEST(Modbus, MB_15_AnOwnerThatDiesInAnExchangeLosesItsLease) {
  BenchConfig config = modbus_bench_config(2);
  config.setup.lease_ticks = 50'000'000 / config.setup.period_ns;
  config.modbus.frame_timeout_ms = 10;
  ModbusBench bench(config);
  ASSERT_EQ(bench.request(lease_input(LeaseAction::kAcquire, 1)), Refused::kNot);  // and never commands
  {
    Client owner(bench.port());
    ASSERT_EQ(owner.write(400, {7}), 0);
    owner.send(adu_of(9, 1, read_write_pdu(200, kSampleLength, 402, command_words(1, 0, 3.0f, 0.0f))));
    owner.send(adu_of(10, 1, pdu_of(3, {0, 1})));
    bench.until([&] { return bench.count("requests") == 2; });
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    EXPECT_EQ(bench.count("connections"), 1u) << "a living owner may wait";
  }
  bench.until([&] { return bench.count("connections") == 0; });
  bench.until([&] { return bench.owner(0) == 0; });
  EXPECT_EQ(bench.owner(1), kTcpSession);
}

// Catches: a real-time exchange that is answered with the sample it had already, or not at all.
TEST(Modbus, ARealTimeExchangeBringsANewSample) {
  BenchConfig config = with_lease(60'000, RunMode::kRealtime);
  config.setup.watchdog_ticks = 1'000'000;
  ModbusBench bench(config);
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  std::uint64_t tick = read_sample(client.read(kSampleStart, kSampleLength)).tick;
  for (int i = 0; i < 200; ++i) {
    const Words words = client.exchange(1, static_cast<std::uint32_t>(tick), 2.0f, 0.0f);
    ASSERT_EQ(words.size(), kSampleLength) << client.last_exception();
    const Sample sample = read_sample(words);
    EXPECT_GT(sample.tick, tick);
    tick = sample.tick;
  }
  bench.until([&] { return bench.newest().u_a_v == 2.0; });
  const auto write_parameter = client.write(1002, {0x4000, 0});
  EXPECT_EQ(write_parameter, 0);
  EXPECT_EQ(client.read(1002, 2), (Words{0x4000, 0}));
}

// Catches: a lease in a free run, which has none; parameters that need one there.
TEST(Modbus, AFreeRunTakesNoController) {
  BenchConfig config = modbus_bench_config();
  config.mode = RunMode::kFree;
  ModbusBench bench(config);
  Client client(bench.port());
  EXPECT_EQ(client.read_one(26), 2);
  EXPECT_EQ(client.write(400, {7}), 4);
  EXPECT_EQ(client.read_one(410), 9);
  EXPECT_EQ(client.write(1002, {0x4000, 0}), 0);
}

}  // namespace
}  // namespace drivebench::modbus::lease_test
