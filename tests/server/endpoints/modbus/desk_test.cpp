// Writes that are carried out as a whole: the inputs that reach the bench, their order, and the state after a
// refusal.
#include <cmath>

#include "plant/faults.hpp"
#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::desk_test {
namespace {

constexpr Visitor kClient = 1;

/// Keeps inputs up to its room and answers them when told.
class SlowEngine final : public Engine {
 public:
  explicit SlowEngine(const BenchConfig& config) : Engine(config, nullptr) {}

  std::size_t room = 256;
  std::vector<Input> inputs;

  void answer_all() {
    const std::vector<Answer> answers = std::move(answers_);
    answers_.clear();
    for (const Answer& answer : answers)
      answer(Refused::kNot, tick());
  }

  Refused check(std::uint32_t, Owner, const Command&) const override { return Refused::kNot; }
  Refused command(std::uint32_t, Owner, const Command&) override { return Refused::kNot; }
  void advance() override {}
  void submit(const Input& input, Answer answer) override {
    if (inputs.size() >= room) return answer(Refused::kBusy, tick());
    inputs.push_back(input);
    answers_.push_back(std::move(answer));
  }
  std::vector<std::byte> save() override { return {}; }
  bool restore(std::span<const std::byte>) override { return false; }
  drivebench::Verdict stop() override { return {}; }
  std::uint64_t state_hash() const override { return 0; }

 private:
  std::vector<Answer> answers_;
};

/// An axis of a free run, where parameters need no lease.
struct Desk {
  static BenchConfig config() {
    BenchConfig config = modbus_bench_config();
    config.mode = RunMode::kFree;
    return config;
  }

  /// Runs until the write waits for the bench or has ended.
  void write(std::uint16_t address, Words written) {
    words = std::move(written);
    const auto range = map.find(address, static_cast<std::uint16_t>(words.size()));
    ASSERT_TRUE(range);
    asio::co_spawn(io, axis.write(*range, words, kClient),
                   [this](const std::exception_ptr&, AxisDesk::Outcome o) { outcome = o; });
    run();
  }
  void run() {
    io.restart();
    io.poll();
  }

  asio::io_context io;
  SlowEngine engine{config()};
  std::vector<ParameterInfo> infos = parameter_infos(servo_axis());
  RegisterMap map{infos, true};
  AxisDesk axis{io, engine, map, 0};
  Words words;
  std::optional<AxisDesk::Outcome> outcome;
};

double parameter(const Engine& engine, std::size_t place) {
  const AxisParameters& p = engine.parameters(0);
  return axis_parameters(p)[parameter_rows(p)[place]].get(p);
}

// Catches: a block of parameters that takes a tick for each, and is half written in between.
TEST(ModbusDesk, ABlockOfParametersGoesToTheBenchTogether) {
  Desk desk;
  desk.write(1002, {0x4000, 0, 0x4000, 0});  // 2 ohm each
  EXPECT_EQ(desk.engine.inputs.size(), 2u);
  EXPECT_FALSE(desk.outcome) << "the bench has not answered yet";
  desk.engine.answer_all();
  desk.run();
  ASSERT_TRUE(desk.outcome);
  EXPECT_EQ(desk.outcome->exception, Exception::kNone);
  EXPECT_EQ(parameter(desk.engine, 1), 2.0);
  EXPECT_EQ(parameter(desk.engine, 2), 2.0);
}

// Catches: a parameter that found no room on its way to the bench and reads as if it had arrived.
TEST(ModbusDesk, AParameterThatDidNotReachTheBenchReadsAsBefore) {
  Desk desk;
  desk.engine.room = 1;
  const double second = parameter(desk.engine, 2);
  const double third = parameter(desk.engine, 3);
  ASSERT_NE(second, 2.0);
  desk.write(1002, {0x4000, 0, 0x4000, 0, 0x3e00, 0});
  desk.engine.answer_all();
  desk.run();
  ASSERT_TRUE(desk.outcome);
  EXPECT_EQ(desk.outcome->exception, Exception::kBusy);
  EXPECT_EQ(desk.outcome->refused, Refused::kBusy);
  EXPECT_EQ(desk.engine.inputs.size(), 1u);
  EXPECT_EQ(parameter(desk.engine, 1), 2.0) << "this one is on its way";
  EXPECT_EQ(parameter(desk.engine, 2), second);
  EXPECT_EQ(parameter(desk.engine, 3), third);
}

// Catches: a refused command that prolongs a lease without a connection, or that gives it away.
TEST(ModbusDesk, ARefusedCommandDoesNotProlongALeaseThatLapses) {
  BenchConfig config = modbus_bench_config();
  config.setup.lease_ticks = 500'000'000 / config.setup.period_ns;
  config.modbus.idle_timeout_ms = 1'000'000;
  ModbusBench bench(config);
  {
    Client owner(bench.port());
    ASSERT_EQ(owner.write(400, {7}), 0);
  }
  bench.until([&] { return bench.count("connections") == 0; });
  Client other(bench.port());
  Words all{7, 0};
  const Words stale = command_words(1, 77, 0.0f, 0.0f);
  all.insert(all.end(), stale.begin(), stale.end());
  EXPECT_EQ(other.write(400, all), 4);
  EXPECT_NE(other.read_one(409), 1) << "the lease did not change hands";
  bench.until([&] { return bench.owner() == 0; });
}

// Catches: a malformed command that does not count, so that its sender may clear a fault whose cause lasts; a
// stranger's command that counts against the owner.
TEST(ModbusDesk, AMalformedCommandCountsAgainstItsSender) {
  ModbusBench bench(tripping_bench_config());
  Client owner(bench.port());
  Client other(bench.port());
  ASSERT_EQ(owner.write(400, {7}), 0);
  std::uint32_t tick = 0;
  while (tick < 50 && (bench.newest().faults & kOverCurrentTrip) == 0)
    ASSERT_FALSE(owner.exchange(1, tick++, 80.0f, 0.0f).empty());
  const auto command_well = [&] { ASSERT_FALSE(owner.exchange(0, tick++, 0.0f, 0.0f).empty()); };
  for (int i = 0; i < 400; ++i)  // until the current has decayed
    command_well();
  ASSERT_NE(bench.newest().faults & kLatchedFaults, 0u);
  const Words malformed = command_words(1, tick, std::nanf(""), 0.0f);
  Words with_key{7, 0};
  with_key.insert(with_key.end(), malformed.begin(), malformed.end());
  const auto clear_is_refused = [&] { return owner.write(401, {1}) == 4 && owner.read_one(410) == 11; };

  EXPECT_EQ(owner.write(402, malformed), 3);
  EXPECT_TRUE(clear_is_refused()) << "the last command of the owner was malformed";
  command_well();
  EXPECT_EQ(owner.write(402, command_words(3, tick, 1.5f, 0.0f)), 3);
  EXPECT_TRUE(clear_is_refused()) << "a duty above 1";
  command_well();
  EXPECT_EQ(owner.write(122, {2}), 3);
  EXPECT_TRUE(clear_is_refused()) << "process data with an unknown mode";
  command_well();
  EXPECT_EQ(other.write(400, with_key), 3);
  EXPECT_TRUE(clear_is_refused()) << "the key is that of the owner";
  command_well();
  EXPECT_EQ(other.write(402, malformed), 3);
  with_key[0] = 8;
  EXPECT_EQ(other.write(400, with_key), 3);
  EXPECT_EQ(owner.write(401, {1}), 0) << "these two came from a stranger";
  command_well();
  EXPECT_EQ(bench.newest().faults & kLatchedFaults, 0u);
  EXPECT_EQ(bench.newest().refused_commands, 4u) << "those of the owner";
}

// Catches: an owner that reads the refusal of a stranger instead of its own.
TEST(ModbusDesk, LastRefusalShowsTheOwnerTheRefusalOfItsOwnWrite) {
  ModbusBench bench;
  Client owner(bench.port());
  Client other(bench.port());
  ASSERT_EQ(owner.write(400, {7}), 0);
  EXPECT_TRUE(owner.exchange(1, 77, 0.0f, 0.0f).empty());
  EXPECT_EQ(other.write(400, {8}), 6);
  EXPECT_EQ(other.read_one(410), 3) << "owned by another";
  EXPECT_EQ(owner.read_one(410), 6) << "stale";
  EXPECT_EQ(owner.write(402, {9}), 3);
  EXPECT_EQ(owner.read_one(410), 8);
  ASSERT_EQ(owner.write(400, {0}), 0);
  ASSERT_EQ(other.write(400, {8}), 0);
  EXPECT_EQ(other.read_one(410), 0) << "nothing that the new owner wrote";
}

// Catches: a release together with a request that is silently not carried out.
TEST(ModbusDesk, AReleaseWithAnotherRequestIsRefused) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  for (const std::uint16_t request : Words{1, 3}) {
    EXPECT_EQ(client.write(400, {0, request}), 3) << request;
    EXPECT_NE(bench.owner(), 0u);
  }
  EXPECT_EQ(client.write(400, {0, 2}), 0) << "both say release";
  EXPECT_EQ(bench.owner(), 0u);
  ASSERT_EQ(client.write(400, {7}), 0);
  EXPECT_EQ(client.write(400, {0, 0}), 0);
  EXPECT_EQ(bench.owner(), 0u);
}

// Catches: an exchange that reads back the words as written instead of the registers.
TEST(ModbusDesk, AnExchangeReadsWhatTheRegistersShow) {
  ModbusBench bench;
  Client client(bench.port());
  EXPECT_EQ(Client::words_in(client.ask(read_write_pdu(400, 2, 400, {7, 3}))), (Words{7, 0}))
      << "request reads as 0";
  EXPECT_EQ(client.ask(read_write_pdu(399, 2, 400, {7, 3})), exception_pdu(23, 2));
}

}  // namespace
}  // namespace drivebench::modbus::desk_test
