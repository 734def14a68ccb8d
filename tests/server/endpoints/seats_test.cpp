// One table of cases about leases over the three transports: whatever a client speaks, a lease begins, holds
// and ends in the same way.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bench.pb.h"
#include "plant/faults.hpp"
#include "protocols/can/command.hpp"
#include "protocols/framing.hpp"
#include "server/endpoints/can/endpoint.hpp"
#include "server/endpoints/modbus/modbus_server.hpp"
#include "server/endpoints/tcp/stream_server.hpp"
#include "tests/server/endpoints/can/memory_bus.hpp"
#include "tests/server/endpoints/modbus/modbus_bench.hpp"
#include "tests/server/endpoints/simulated_clock.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::seats_test {
namespace {

using namespace std::chrono_literals;

constexpr auto kIdleTimeout = 200ms;
constexpr auto kHeartbeatTimeout = 100ms;
constexpr auto kLeaseTime = 300ms;

BenchConfig bench_config() {
  BenchConfig config = modbus::modbus_bench_config();
  config.modbus.idle_timeout_ms = kIdleTimeout.count();
  config.setup.lease_ticks = std::chrono::nanoseconds(kLeaseTime).count() / config.setup.period_ns;
  CanConfig can;
  can.idle_timeout_ms = kIdleTimeout.count();
  can.controller_timeout_ms = kHeartbeatTimeout.count();
  config.can.push_back(can);
  return config;
}

TcpConfig system_port() {
  TcpConfig config;
  config.port = 0;
  return config;
}

std::uint16_t port_of(const std::string& address) {
  return static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1)));
}

/// One lockstep bench of one axis with all three transports, in the time of a simulated clock.
struct World {
  World() {
    stream_server.serve(
        *engine, [] { return std::vector<TransportReport>(); }, nullptr);
    can_endpoint.serve(*engine);
    modbus_server.serve(*engine);
  }
  ~World() {
    engine->stop();
    stream_server.close();
    modbus_server.close();
    can_endpoint.close();
    settle();
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  void settle() {
    io.restart();
    while (io.poll() != 0)
      io.restart();
  }
  /// Runs until the answer has come.
  template <class Condition>
  void until(Condition condition) {
    const auto end = std::chrono::steady_clock::now() + 30s;
    while (!condition()) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << "no answer";
      settle();
    }
  }
  void pass(ServerClock::duration time) {
    for (ServerClock::duration passed{}; passed < time; passed += 10ms) {
      clock.pass(io, 10ms);
      settle();
    }
  }

  SimulatedClock clock;
  asio::io_context io{1};
  BenchConfig config = bench_config();
  can::MemoryWire wire{io};
  StreamServer stream_server{io, system_port()};
  can::Endpoint can_endpoint{io, config.can.front(), wire.connect("bench")};
  ModbusServer modbus_server{io, config.modbus};
  std::unique_ptr<Engine> engine = make_lockstep_engine(config);
};

/// A client on one transport. Every method but vanish() waits for the answer and says whether it was yes.
class SeatClient {
 public:
  virtual ~SeatClient() = default;
  virtual bool acquire() = 0;
  virtual bool renew() = 0;
  virtual bool release() = 0;
  /// Commands this voltage for the present tick.
  virtual bool command(float u_a_v) = 0;
  /// The client goes away without a release, and the time passes that the transport gives it.
  virtual void vanish() = 0;
};

class TcpClient final : public SeatClient {
 public:
  explicit TcpClient(World& world) : world_(world), socket_(world.io) {
    socket_.connect({asio::ip::make_address("127.0.0.1"), port_of(world.stream_server.tcp_address())});
    socket_.non_blocking(true);
    v1::Envelope hello;
    hello.mutable_hello()->set_protocol_min(1);
    hello.mutable_hello()->set_protocol_max(1);
    ask(hello);
  }
  bool acquire() override { return lease(v1::LeaseRequest::ACTION_ACQUIRE); }
  bool renew() override { return lease(v1::LeaseRequest::ACTION_RENEW); }
  bool release() override { return lease(v1::LeaseRequest::ACTION_RELEASE); }
  bool command(float u_a_v) override {
    v1::Envelope request;
    v1::Command& command = *request.mutable_exchange()->add_commands();
    command.set_tick(static_cast<std::uint64_t>(world_.engine->tick()));
    command.set_gates(v1::GATES_VOLTAGE);
    command.set_u_a_v(static_cast<double>(u_a_v));
    return ask(request);
  }
  void vanish() override {
    socket_.close();
    world_.until([this] { return world_.engine->owner(0) == 0; });
  }

 private:
  bool lease(v1::LeaseRequest::Action action) {
    v1::Envelope request;
    request.mutable_lease()->set_action(action);
    return ask(request);
  }
  bool ask(v1::Envelope& request) {
    request.set_id(++last_id_);
    const std::string payload = request.SerializeAsString();
    const auto header = frame_header(static_cast<std::uint32_t>(payload.size()));
    socket_.send(std::array<asio::const_buffer, 2>{asio::buffer(header), asio::buffer(payload)});
    v1::Envelope answer;
    world_.until([&] { return receive(answer); });
    return !answer.has_refusal();
  }
  /// True with the answer to the last request; passes over notices.
  bool receive(v1::Envelope& answer) {
    boost::system::error_code error;
    const std::span<std::byte> space = reader_.free_space();
    if (!space.empty()) {
      reader_.received(socket_.read_some(asio::buffer(space.data(), space.size()), error));
    }
    while (const auto frame = reader_.next()) {
      answer.ParseFromArray(frame->data(), static_cast<int>(frame->size()));
      if (answer.id() == last_id_) return true;
    }
    return false;
  }

  World& world_;
  asio::ip::tcp::socket socket_;
  FrameReader reader_{kMaxReplyFrame};
  std::uint64_t last_id_ = 0;
};

class CanClient final : public SeatClient {
 public:
  explicit CanClient(World& world) : world_(world), bus_(world.wire.connect("controller")) {
    static double last_controller = 0.0;
    controller_ = ++last_controller;
    bus_->on_frame = [this](const can::Frame& frame, std::int64_t) {
      const can::Match found = can::match(profile_, frame);
      if (!found.ok() || found.row->message != can::Message::kReply) return;
      const can::Values values = can::decode(*found.row, profile_, frame);
      const auto field = [&](std::string_view name) { return values[can::index_of(*found.row, name)]; };
      if (field("controller") != controller_ && field("controller") != 0.0) return;
      result_ = field("result");
      if (field("request") == static_cast<double>(can::Request::kAcquire)) lease_ = field("lease");
    };
  }
  bool acquire() override { return ask(can::Request::kAcquire); }
  bool renew() override { return ask(can::Request::kRenew); }
  bool release() override { return ask(can::Request::kRelease); }
  bool command(float u_a_v) override {
    const Tick before = world_.engine->tick();
    result_.reset();
    const can::CommandFields setpoints{.tick = static_cast<std::uint64_t>(before),
                                       .mode = 1,
                                       .lease = static_cast<unsigned>(lease_),
                                       .a = static_cast<double>(u_a_v)};
    for (const can::Frame& frame : can::encode_command(profile_, 1, false, setpoints))
      bus_->send(frame);
    world_.settle();
    EXPECT_NE(world_.engine->tick() != before, result_.has_value()) << "a refusal is answered";
    return world_.engine->tick() != before;
  }
  void vanish() override {
    send(can::Message::kControllerHeartbeat, std::array{5.0});
    world_.pass(kHeartbeatTimeout + 20ms);
  }

 private:
  bool ask(can::Request request) {
    result_.reset();
    send(can::Message::kRequest, std::array{static_cast<double>(request), lease_, controller_});
    EXPECT_TRUE(result_) << "no answer";
    return result_ == 0.0;
  }
  void send(can::Message message, std::span<const double> values) {
    bus_->send(can::encode(*can::find_message(message, profile_.fd, false), profile_, 1, values));
    world_.settle();
  }

  World& world_;
  can::Profile profile_ = world_.config.can.front().profile;
  std::unique_ptr<can::Bus> bus_;
  double controller_ = 0.0;
  double lease_ = 0.0;
  std::optional<double> result_;
};

class ModbusClient final : public SeatClient {
 public:
  explicit ModbusClient(World& world) : world_(world), socket_(world.io) {
    static std::uint16_t last_key = 0;
    key_ = ++last_key;
    socket_.connect({asio::ip::make_address("127.0.0.1"), port_of(world.modbus_server.address())});
    socket_.non_blocking(true);
  }
  bool acquire() override { return ask(modbus::write_pdu(400, {key_})); }
  bool renew() override { return ask(modbus::write_pdu(401, {3})); }
  bool release() override { return ask(modbus::write_pdu(400, {0})); }
  bool command(float u_a_v) override {
    const auto tick = static_cast<std::uint32_t>(world_.engine->tick());
    return ask(modbus::write_pdu(402, modbus::command_words(1, tick, u_a_v, 0.0f)));
  }
  void vanish() override {
    socket_.close();
    world_.pass(kLeaseTime + 20ms);
  }

 private:
  bool ask(const modbus::Bytes& pdu) {
    socket_.send(asio::buffer(modbus::adu_of(1, 1, pdu)));
    modbus::Bytes answer;
    world_.until([&] {
      std::array<std::uint8_t, 256> bytes{};
      boost::system::error_code error;
      const std::size_t count = socket_.read_some(asio::buffer(bytes), error);
      answer.insert(answer.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
      return answer.size() > 8;
    });
    return answer.size() > 8 && (answer[7] & 0x80) == 0;
  }

  World& world_;
  asio::ip::tcp::socket socket_;
  std::uint16_t key_ = 0;
};

struct Transport {
  std::string name;
  std::unique_ptr<SeatClient> (*connect)(World&);
  bool idle_clients_lose =
      false;  ///< in lockstep; over TCP an idle session shows by its socket that it lives
};

template <class Kind>
std::unique_ptr<SeatClient> connect(World& world) {
  return std::make_unique<Kind>(world);
}

class Seats : public testing::TestWithParam<Transport> {
 protected:
  std::unique_ptr<SeatClient> client() { return GetParam().connect(world_); }
  Owner owner() const { return world_.engine->owner(0); }
  /// The faults in the sample of the next tick, which another session commands with the gates off.
  std::uint64_t faults_of_next_tick() {
    const Owner number = world_.engine->new_owner({.transport = "test", .peer = {}, .subject = {}});
    world_.engine->request({.tick = 0, .axis = 0, .owner = number, .action = LeaseAction::kAcquire},
                           [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
    world_.engine->command(0, number, {.answers = world_.engine->tick(), .phases = {}});
    world_.engine->advance();
    return world_.engine->newest(0).faults;
  }

  World world_;
};

// Catches: a second holder, a renewal by a client that holds nothing, or a release that does not free the
// axis.
TEST_P(Seats, OneClientAtATimeHoldsTheAxis) {
  const auto first = client();
  const auto second = client();
  EXPECT_FALSE(first->renew());
  EXPECT_FALSE(first->command(1.0f));
  ASSERT_TRUE(first->acquire());
  const Owner number = owner();
  EXPECT_NE(number, 0u);
  EXPECT_FALSE(second->acquire());
  EXPECT_FALSE(second->renew());
  EXPECT_FALSE(second->release());
  EXPECT_FALSE(second->command(1.0f));
  EXPECT_EQ(owner(), number);
  EXPECT_TRUE(first->renew());
  EXPECT_TRUE(first->command(1.0f));
  EXPECT_EQ(owner(), number);
  EXPECT_TRUE(first->release());
  EXPECT_EQ(owner(), 0u);
  EXPECT_FALSE(first->renew());
  EXPECT_FALSE(first->command(1.0f));
  EXPECT_TRUE(second->acquire());
  EXPECT_GT(owner(), number);
}

// Catches: a released axis that latches, or one whose controller vanished and that does not.
TEST_P(Seats, AVanishedClientLatchesTheLossAndAReleaseDoesNot) {
  auto holder = client();
  ASSERT_TRUE(holder->acquire());
  ASSERT_TRUE(holder->command(1.0f));
  ASSERT_TRUE(holder->release());
  EXPECT_EQ(world_.engine->newest(0).faults & kLeaseLost, 0u);
  ASSERT_TRUE(holder->acquire());
  ASSERT_TRUE(holder->command(1.0f));
  holder->vanish();
  EXPECT_EQ(owner(), 0u);
  EXPECT_NE(faults_of_next_tick() & kLeaseLost, 0u);
}

// Catches: a transport whose client still holds, renews or commands an axis that an administrator has taken.
TEST_P(Seats, AClientLosesAnAxisThatIsTakenByForce) {
  const auto holder = client();
  ASSERT_TRUE(holder->acquire());
  const Owner before = owner();
  const Owner admin = world_.engine->new_owner({.transport = "tcp", .peer = "admin", .subject = {}});
  world_.engine->take(0, admin, "maintenance",
                      [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
  world_.settle();
  EXPECT_EQ(owner(), admin);
  EXPECT_GT(admin, before);
  EXPECT_FALSE(holder->renew());
  EXPECT_FALSE(holder->command(1.0f));
  EXPECT_FALSE(holder->acquire());
  EXPECT_FALSE(holder->release());
  EXPECT_EQ(owner(), admin);
}

// Catches: a transport that does not notice that the bench has ended the lease, and so refuses the axis to
// its clients for ever, or gives the old number to the new lease.
TEST_P(Seats, ALeaseThatTheBenchEndedCanBeAcquiredAnew) {
  const auto holder = client();
  const auto other = client();
  ASSERT_TRUE(holder->acquire());
  const Owner before = owner();
  world_.engine->request({.tick = 0, .axis = 0, .owner = before, .action = LeaseAction::kLost},
                         [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
  EXPECT_FALSE(holder->renew());
  EXPECT_FALSE(holder->command(1.0f));
  EXPECT_TRUE(other->acquire());
  EXPECT_GT(owner(), before);
  EXPECT_FALSE(holder->command(1.0f));
  EXPECT_TRUE(other->command(1.0f));
}

// Catches: a bench in lockstep that waits for ever for an idle holder, or a time-out that meets a holder that
// renews.
TEST_P(Seats, AnIdleHolderLosesTheLeaseUnlessItsConnectionShowsItsEnd) {
  const auto holder = client();
  ASSERT_TRUE(holder->acquire());
  for (int i = 0; i < 5; ++i) {
    world_.pass(kIdleTimeout - 40ms);
    EXPECT_TRUE(holder->renew());
  }
  world_.pass(kIdleTimeout + 20ms);
  EXPECT_EQ(owner() == 0, GetParam().idle_clients_lose);
}

INSTANTIATE_TEST_SUITE_P(
    Over, Seats,
    testing::Values(Transport{.name = "Tcp", .connect = connect<TcpClient>},
                    Transport{.name = "Can", .connect = connect<CanClient>, .idle_clients_lose = true},
                    Transport{.name = "Modbus", .connect = connect<ModbusClient>, .idle_clients_lose = true}),
    [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace drivebench::seats_test
