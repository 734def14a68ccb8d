// The controller's side of the register map against a server in this process.
#include "clients/link/modbus/modbus_link.hpp"

#include <gtest/gtest.h>
#include <modbus/modbus.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <bit>
#include <thread>
#include <vector>

#include "clients/link/common/address.hpp"
#include "protocols/modbus/register_map.hpp"

namespace drivebench::link::modbus_link_test {
namespace {

using namespace std::chrono_literals;

/// Serves one connection at a time from plain registers. A written command makes the next sample.
class FakeServer {
 public:
  FakeServer() : context_(::modbus_new_tcp("127.0.0.1", 0)), map_(::modbus_mapping_new(0, 0, 2000, 0)) {
    listener_ = ::modbus_tcp_listen(context_, 1);
    sockaddr_in here = {};
    socklen_t size = sizeof here;
    ::getsockname(listener_, reinterpret_cast<sockaddr*>(&here), &size);
    address.port = std::to_string(ntohs(here.sin_port));
    address.host = "127.0.0.1";
    put(0, modbus::Type::kUnsigned16, modbus::kMarker);
    put(1, modbus::Type::kUnsigned16, modbus::kMapVersion);
    put(26, modbus::Type::kUnsigned16, 1);
    put(27, modbus::Type::kUnsigned16, 1);
    put(28, modbus::Type::kUnsigned32, 125'000);
    put_sample();
    thread_ = std::thread([this] { serve(); });
  }
  ~FakeServer() {
    ::shutdown(listener_, SHUT_RDWR);
    thread_.join();
    ::close(listener_);
    ::modbus_mapping_free(map_);
    ::modbus_free(context_);
  }
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;

  void put(std::uint16_t at, modbus::Type type, std::uint64_t bits) {
    modbus::put(bits, type, modbus::WordOrder::kAbcd, &map_->tab_registers[at]);
  }
  std::uint64_t get(std::uint16_t at, modbus::Type type) const {
    return modbus::get(type, modbus::WordOrder::kAbcd, &map_->tab_registers[at]);
  }
  void put_sample() {
    for (const modbus::Row& row : modbus::map_detail::kSample)
      put(row.address, row.type, modbus::signal_bits(row, sample));
    for (const modbus::Row& row : modbus::map_detail::kMoreSample)
      put(row.address, row.type, modbus::signal_bits(row, sample));
  }

  ModbusAddress address;
  Sample sample;
  std::atomic<unsigned> exception = 0;  ///< answers every write
  std::atomic<int> samples_behind = 0;  ///< so many reads more until a command shows
  std::atomic<bool> silent = false;

 private:
  void serve() {
    while (::modbus_tcp_accept(context_, &listener_) >= 0) {
      std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> request{};
      for (int size = 0; (size = ::modbus_receive(context_, request.data())) >= 0;) {
        if (size > 0) answer(request.data(), size);
      }
      ::modbus_close(context_);
    }
  }
  void answer(const std::uint8_t* request, int size) {
    const unsigned function = request[7];
    const bool writes = function != 3;
    if (silent) return;
    if (writes && exception != 0) {
      ::modbus_reply_exception(context_, request, exception);
      return;
    }
    const bool commands = function == 23;
    if (samples_behind > 0) --samples_behind;
    if (commands || late_) {
      late_ = samples_behind > 0;
      if (!late_) ++sample.tick;
      put_sample();
    }
    ::modbus_reply(context_, request, size, map_);
  }

  modbus_t* context_;
  modbus_mapping_t* map_;
  int listener_ = -1;
  bool late_ = false;
  std::thread thread_;
};

v1::RefusalCode refusal_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const RefusalError& refused) {
    return refused.code();
  }
  return v1::REFUSAL_UNSPECIFIED;
}

// Catches: a port or unit read from the wrong place.
TEST(ModbusAddress, ReadsHostPortAndUnit) {
  const ModbusAddress a = parse_modbus_address("modbus:host:1503?unit=7");
  EXPECT_EQ(a.host + " " + a.port, "host 1503");
  EXPECT_EQ(a.unit, 7);
  EXPECT_EQ(parse_modbus_address("modbus:host").port, "1502");
  EXPECT_EQ(parse_modbus_address("modbus:[::1]").host, "::1");
  EXPECT_EQ(parse_modbus_address("modbus:host").unit, 1);
  for (const char* text : {"modbus:", "modbus:host:0", "modbus:host?unit=0", "modbus:host?unit=248",
                           "modbus:host?unit=", "modbus:host?node=1", "modbus:host?unit=1x"}) {
    EXPECT_THROW(parse_modbus_address(text), AddressError) << text;
  }
}

// Catches: a register at the wrong address, a word order the wrong way round, a sign or a 64-bit value cut
// off.
TEST(ModbusLink, ReadsAndCommandsByTheMap) {
  FakeServer server;
  server.sample = {.tick = 0x1'0000'0005, .encoder_count = -7, .i_a_a = 1.5};
  server.put_sample();
  ModbusLink link(server.address);
  EXPECT_EQ(link.bench().mode(), v1::MODE_LOCKSTEP);
  EXPECT_DOUBLE_EQ(link.bench().period_s(), 125e-6);
  link.acquire();
  EXPECT_NE(server.get(400, modbus::Type::kUnsigned16), 0U);
  EXPECT_EQ(link.newest().tick, 0x1'0000'0005U);
  EXPECT_EQ(link.newest().encoder_count, -7);
  EXPECT_EQ(link.newest().i_a_a, 1.5);
  EXPECT_EQ(
      link.exchange({.tick = 0x1'0000'0005, .gates = v1::GATES_VOLTAGE, .u_a_v = 12.5, .u_b_v = -0.25}).tick,
      0x1'0000'0006U);
  EXPECT_EQ(server.get(422, modbus::Type::kUnsigned16), 1U);
  EXPECT_EQ(server.get(423, modbus::Type::kUnsigned32), 5U);
  EXPECT_EQ(server.get(425, modbus::Type::kFloat32), std::bit_cast<std::uint32_t>(12.5F));
  EXPECT_EQ(server.get(427, modbus::Type::kFloat32), std::bit_cast<std::uint32_t>(-0.25F));
  link.clear_faults();
  EXPECT_EQ(server.get(401, modbus::Type::kUnsigned16), 1U);
  link.release();
  EXPECT_EQ(server.get(401, modbus::Type::kUnsigned16), 2U);
  EXPECT_TRUE(link.knows("angle_rad"));
  EXPECT_THROW(link.set_load({}), RefusalError);
}

// Catches: currents sent for voltages or as duties, a phase or the field in another's place, a sensor behind
// the first block that is not read, truth that is not read and passed off as known.
TEST(ModbusLink, CommandsEveryTerminalAndReadsEverySensor) {
  FakeServer server;
  ModbusLink link(server.address);
  link.acquire();
  const auto setpoints = [&server] {
    std::vector<double> values;
    for (const std::uint16_t address : std::to_array<std::uint16_t>({425, 427, 429, 431}))
      values.push_back(
          modbus::number_of(modbus::Type::kFloat32, server.get(address, modbus::Type::kFloat32)));
    return values;
  };
  server.sample.i_c_a = -1.5;
  server.sample.hall_lines = 5;
  server.sample.temperature_k = 350.0;
  server.sample.injected = 0x8000'0001;
  const Sample& sample = link.exchange(
      {.tick = 0, .gates = v1::GATES_VOLTAGE, .u_a_v = 1.0, .u_b_v = 2.0, .u_c_v = -3.0, .u_f_v = 24.0});
  EXPECT_EQ(setpoints(), (std::vector<double>{1.0, 2.0, -3.0, 24.0}));
  EXPECT_EQ(sample.i_c_a, -1.5);
  EXPECT_EQ(sample.hall_lines, 5U);
  EXPECT_EQ(sample.temperature_k, 350.0);
  EXPECT_EQ(sample.injected, 0x8000'0001U);
  link.exchange({.tick = 1,
                 .gates = v1::GATES_CURRENT,
                 .u_c_v = 9.0,
                 .i_a_a = 0.5,
                 .i_b_a = -0.5,
                 .i_c_a = 0.25,
                 .i_f_a = 2.0});
  EXPECT_EQ(setpoints(), (std::vector<double>{0.5, -0.5, 0.25, 2.0}));
  EXPECT_EQ(server.get(422, modbus::Type::kUnsigned16), 4U);
  for (const char* name : {"tick", "true_i_a_a", "i_f_a", "meter_pf", "injected"})
    EXPECT_TRUE(link.knows(name)) << name;
  for (const char* name : {"load_angle_rad", "load_position_m"})
    EXPECT_FALSE(link.knows(name)) << name;
}

// Catches: duties sent as voltages or in mode 3, which counts a star's legs from the middle; a register that
// an earlier bench lacks, written to it; a leg that stays off because the register is not written again.
TEST(ModbusLink, CommandsDutiesAndLegs) {
  FakeServer server;
  ModbusLink link(server.address);
  link.acquire();
  const auto legs_off = [&server] { return server.get(433, modbus::Type::kUnsigned16); };
  server.put(433, modbus::Type::kUnsigned16, 99);
  link.exchange({.tick = 0, .gates = v1::GATES_DUTY, .u_a_v = 9.0, .d_a = 0.25, .d_c = 1.0});
  EXPECT_EQ(server.get(422, modbus::Type::kUnsigned16), 5U);
  EXPECT_EQ(server.get(425, modbus::Type::kFloat32), std::bit_cast<std::uint32_t>(0.25F));
  EXPECT_EQ(server.get(429, modbus::Type::kFloat32), std::bit_cast<std::uint32_t>(1.0F));
  EXPECT_EQ(legs_off(), 99U);
  link.exchange({.tick = 1, .gates = v1::GATES_DUTY, .legs_off = 6});
  EXPECT_EQ(legs_off(), 6U);
  link.exchange({.tick = 2, .gates = v1::GATES_DUTY});
  EXPECT_EQ(legs_off(), 0U);
}

// Catches: an axis that stays taken by a controller that is gone.
TEST(ModbusLink, GivesTheAxisBackAtItsEnd) {
  FakeServer server;
  {
    ModbusLink link(server.address);
    link.acquire();
    EXPECT_EQ(server.get(401, modbus::Type::kUnsigned16), 0U);
  }
  EXPECT_EQ(server.get(401, modbus::Type::kUnsigned16), 2U);
}

// Catches: the sample of the tick itself taken for the next one.
TEST(ModbusLink, RealTimeWaitsForTheNextTick) {
  FakeServer server;
  ModbusLink link(server.address);
  server.samples_behind = 3;
  EXPECT_EQ(link.exchange({.tick = 0, .gates = v1::GATES_OFF}).tick, 1U);
}

// Catches: an exception that is taken for another, or a reason that is not asked for.
TEST(ModbusLink, ExceptionsHaveTheirMeaning) {
  FakeServer server;
  ModbusLink link(server.address);
  struct Case {
    unsigned exception;
    unsigned last_refusal;
    v1::RefusalCode code;
  };
  for (const Case& c :
       {Case{6, 3, v1::REFUSAL_OWNED}, Case{6, 2, v1::REFUSAL_NOT_OWNER}, Case{6, 7, v1::REFUSAL_BUSY},
        Case{6, 0, v1::REFUSAL_BUSY}, Case{6, 999, v1::REFUSAL_BUSY}, Case{4, 5, v1::REFUSAL_LATCHED},
        Case{4, 6, v1::REFUSAL_STALE}, Case{4, 9, v1::REFUSAL_WRONG_MODE},
        Case{4, 10, v1::REFUSAL_WRONG_DRIVE}, Case{3, 0, v1::REFUSAL_OUT_OF_RANGE},
        Case{2, 0, v1::REFUSAL_READ_ONLY}, Case{1, 0, v1::REFUSAL_MALFORMED},
        Case{11, 0, v1::REFUSAL_UNKNOWN_AXIS}}) {
    server.put(410, modbus::Type::kUnsigned16, c.last_refusal);
    server.exception = c.exception;
    EXPECT_EQ(refusal_of([&link] { link.exchange({.tick = 0, .gates = v1::GATES_OFF}); }), c.code)
        << c.exception;
    EXPECT_EQ(refusal_of([&link] { link.acquire(); }), c.code) << c.exception << " " << c.last_refusal;
  }
}

// Catches: a bench that allows no writes found out only in the middle of a move.
TEST(ModbusLink, ABenchWithoutWritesRefusesTheLease) {
  FakeServer server;
  server.put(27, modbus::Type::kUnsigned16, 0);
  ModbusLink link(server.address);
  EXPECT_EQ(refusal_of([&link] { link.acquire(); }), v1::REFUSAL_READ_ONLY);
}

// Catches: another device taken for a bench, and a silent one waited for.
TEST(ModbusLink, AnotherDeviceOrASilentOneIsAnError) {
  FakeServer server;
  server.put(1, modbus::Type::kUnsigned16, modbus::kMapVersion + 1);
  EXPECT_THROW(ModbusLink(server.address), LinkError);
  server.put(1, modbus::Type::kUnsigned16, modbus::kMapVersion);
  ModbusLink link(server.address, 30ms);
  server.silent = true;
  EXPECT_THROW(link.newest(), LinkError);
  server.silent = false;
  EXPECT_THROW(link.newest(), LinkError);  // a late answer answers nothing
  EXPECT_THROW(ModbusLink({.host = "127.0.0.1", .port = "1", .unit = 1}, 1s), ConnectError);
}

}  // namespace
}  // namespace drivebench::link::modbus_link_test
