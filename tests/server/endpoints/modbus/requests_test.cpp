// The answer to each request: MB-01 to MB-04, MB-07, MB-12 of the list of faults.
#include <cmath>
#include <limits>

#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::requests_test {
namespace {

// ---- what the map of version 1 must look like, written down once more ----

struct Area {
  std::size_t start;
  std::size_t length;
};

const std::vector<ParameterInfo>& parameters() {
  static const std::vector<ParameterInfo> infos = parameter_infos(servo_axis());
  return infos;
}

const std::vector<Area>& areas() {
  static const std::vector<Area> whole = [] {
    std::vector<Area> all{{0, 59},
                          {100, 13},
                          {120, 22},
                          {200, 136},
                          {340, 16},
                          {360, 32},
                          {400, 11},
                          {420, 14},
                          {440, 44},
                          {490, 18},
                          {1000, 2 * parameters().size()}};
    for (std::size_t i = 0; i < 11; ++i)
      all.push_back({all[i].start + 10'000, all[i].length});
    return all;
  }();
  return whole;
}

bool exists(std::size_t address, std::size_t count) {
  for (const Area& area : areas()) {
    if (address >= area.start && address + count <= area.start + area.length) return true;
  }
  return false;
}

/// The exception that answers a write of zeros by a connection without the lease.
int verdict_of_zeros(std::size_t address, std::size_t count) {
  if (!exists(address, count)) return 2;
  const std::size_t first = address % 10'000;
  const std::size_t end = first + count;
  if (first >= 1000) {
    if (first % 2 != 0 || count % 2 != 0) return 2;  // half a float
    for (std::size_t row = (first - 1000) / 2; row < (end - 1000) / 2; ++row)
      if (!parameters()[row].live) return 2;
    for (std::size_t row = (first - 1000) / 2; row < (end - 1000) / 2; ++row)
      if (parameters()[row].minimum > 0.0) return 3;
    return 6;
  }
  if (first >= 440) return 2;
  if (first >= 400) {
    const std::size_t block = first < 420 ? 400 : 420;
    const auto is_cut = [&](std::size_t at) { return at > block + 3 && at < block + 13 && at % 2 == 0; };
    return is_cut(first) || is_cut(end) || (block == 400 && end > 409) ? 2 : 6;
  }
  return (first >= 101 && end <= 104) || (first >= 121 && end <= 127) ? 6 : 2;
}

std::vector<std::size_t> edge_addresses() {
  std::vector<std::size_t> edges{0, 1, 65535};
  for (const Area& area : areas())
    for (const std::size_t at : Sizes{area.start - 1, area.start, area.start + 1,
                                      area.start + area.length - 1, area.start + area.length})
      if (at < 65535) edges.push_back(at);
  return edges;
}

/// Two floats and such: everything of the axis but what counts refusals.
std::vector<Words> everything(Client& client) {
  std::vector<Words> all;
  for (const Area& area : areas()) {
    for (std::size_t at = 0; at < area.length; at += 100) {
      all.push_back(client.read(area.start + at, std::min<std::size_t>(area.length - at, 100)));
      EXPECT_FALSE(all.back().empty());
    }
  }
  return all;
}

void expect_verdict(Client& client, const Bytes& pdu, int verdict, std::size_t& count) {
  ++count;
  const Bytes answer = client.ask(pdu);
  ASSERT_FALSE(answer.empty()) << "closed";
  if (verdict == 0) {
    EXPECT_EQ(answer[0], pdu[0]);
  } else {
    EXPECT_EQ(answer, exception_pdu(pdu[0], static_cast<std::uint8_t>(verdict)))
        << "function " << int{pdu[0]} << " address " << (pdu[1] << 8 | pdu[2]) << " quantity "
        << (pdu[3] << 8 | pdu[4]);
  }
}

// Catches: a function that is not served but answered, or not answered at all; one that is missing.
TEST(Modbus, MB_01_EveryFunctionCodeIsAnswered) {
  ModbusBench bench;
  Client client(bench.port());
  const std::vector<int> served{1, 2, 3, 4, 5, 6, 8, 15, 16, 22, 23, 43};
  for (int function = 0; function < 256; ++function) {
    const auto code = static_cast<std::uint8_t>(function);
    if (std::find(served.begin(), served.end(), function) != served.end()) continue;
    EXPECT_EQ(client.ask({code}), exception_pdu(code, 1)) << function;
    EXPECT_EQ(client.ask({code, 0, 0, 0, 1}), exception_pdu(code, 1)) << function;
  }
  EXPECT_EQ(client.ask(pdu_of(1, {0, 2})), (Bytes{1, 1, 0}));
  EXPECT_EQ(client.ask(pdu_of(2, {0, 63})).size(), 2u + 8u);
  EXPECT_EQ(client.ask(pdu_of(3, {0, 2})), (Bytes{3, 4, 'D', 'B', 0, 1}));
  EXPECT_EQ(client.ask(pdu_of(4, {0, 1})), (Bytes{4, 2, 'D', 'B'}));
  EXPECT_EQ(client.ask({8, 0, 0, 0xab, 0xcd}), (Bytes{8, 0, 0, 0xab, 0xcd}));
  EXPECT_EQ(client.ask({8, 0, 1, 0, 0}), exception_pdu(8, 1));
  EXPECT_EQ(client.write(400, {7}), 0);
  EXPECT_EQ(client.ask(pdu_of(5, {1, 0xff00})), pdu_of(5, {1, 0xff00}));
  EXPECT_EQ(client.ask(pdu_of(6, {401, 3})), pdu_of(6, {401, 3}));
  EXPECT_EQ(client.ask({15, 0, 0, 0, 2, 1, 2}), pdu_of(15, {0, 2}));
  EXPECT_EQ(client.ask(write_pdu(400, {7})), pdu_of(16, {400, 1}));
  EXPECT_EQ(client.ask(pdu_of(22, {401, 0, 3})), pdu_of(22, {401, 0, 3}));
  EXPECT_EQ(client.ask(read_write_pdu(0, 1, 400, {7})), (Bytes{23, 2, 'D', 'B'}));
}

// Catches: device identification that clients cannot walk through.
TEST(Modbus, MB_01_TheDeviceIdentifiesItself) {
  ModbusBench bench;
  Client client(bench.port());
  const Bytes basic = client.ask({43, 14, 1, 0});
  ASSERT_GT(basic.size(), 20u);
  EXPECT_EQ(Bytes(basic.begin(), basic.begin() + 9), (Bytes{43, 14, 1, 0x82, 0, 0, 3, 0, 10}));
  EXPECT_EQ(std::string(basic.begin() + 9, basic.begin() + 19), "drivebench");
  const Bytes name = client.ask({43, 14, 4, 6});
  EXPECT_EQ(name, (Bytes{43, 14, 4, 0x82, 0, 0, 1, 6, 4, 't', 'e', 's', 't'}));
  EXPECT_EQ(client.ask({43, 14, 4, 7}), exception_pdu(43, 2));
  EXPECT_EQ(client.ask({43, 14, 5, 0}), exception_pdu(43, 3));
  EXPECT_EQ(client.ask({43, 13, 0, 0}), exception_pdu(43, 1));
  EXPECT_EQ(client.ask({43, 14, 3, 0})[6], 7);
  EXPECT_EQ(client.ask({43, 14, 2, 99})[6], 7) << "an unknown object means from the start";
  EXPECT_EQ(client.ask({43, 14, 2, 5})[6], 2);
}

// Catches: an address checked before the quantity, limits off by one, a range that runs out of its block, a
// write that takes place although it is refused.
TEST(Modbus, MB_02_EveryEdgeOfTheMapHasItsVerdict) {
  ModbusBench bench;
  Client client(bench.port());
  const std::vector<Words> before = everything(client);
  std::size_t count = 0;
  const auto quantity_verdict = [](std::size_t quantity, std::size_t most) {
    return quantity >= 1 && quantity <= most;
  };
  for (const std::size_t address : edge_addresses()) {
    for (const std::size_t quantity : Sizes{0, 1, 2, 13, 86, 125, 126, 65535}) {
      const int verdict = !quantity_verdict(quantity, 125) ? 3 : exists(address, quantity) ? 0 : 2;
      for (const std::uint8_t function : Bytes{3, 4})
        expect_verdict(client, pdu_of(function, {address, quantity}), verdict, count);
    }
    for (const std::size_t quantity : Sizes{0, 1, 2, 4, 123, 124, 65535}) {
      Bytes pdu = write_pdu(address, Words(std::min<std::size_t>(quantity, 123)));
      pdu[3] = static_cast<std::uint8_t>(quantity >> 8);
      pdu[4] = static_cast<std::uint8_t>(quantity);
      const int verdict = quantity_verdict(quantity, 123) ? verdict_of_zeros(address, quantity) : 3;
      expect_verdict(client, pdu, verdict, count);
    }
    for (const std::size_t quantity : Sizes{0, 1, 2, 121, 122}) {
      Bytes pdu = read_write_pdu(0, 1, address, Words(std::min<std::size_t>(quantity, 121)));
      pdu[8] = static_cast<std::uint8_t>(quantity);
      const int verdict = quantity_verdict(quantity, 121) ? verdict_of_zeros(address, quantity) : 3;
      expect_verdict(client, pdu, verdict, count);
    }
    for (const std::size_t quantity : Sizes{0, 1, 125, 126}) {
      const int verdict = !quantity_verdict(quantity, 125) ? 3 : exists(address, quantity) ? 6 : 2;
      expect_verdict(client, read_write_pdu(address, quantity, 401, {0}), verdict, count);
    }
    expect_verdict(client, pdu_of(6, {address, 0}), verdict_of_zeros(address, 1), count);
    expect_verdict(client, pdu_of(22, {address, 0, 0}), verdict_of_zeros(address, 1), count);
  }
  for (const std::size_t address : Sizes{0, 1, 2, 62, 63, 65535}) {
    for (const std::size_t quantity : Sizes{0, 1, 2, 63, 64, 1968, 1969, 2000, 2001, 65535}) {
      const auto bits_verdict = [&](std::size_t most, std::size_t bits) {
        return !quantity_verdict(quantity, most) ? 3 : address + quantity <= bits ? 0 : 2;
      };
      expect_verdict(client, pdu_of(1, {address, quantity}), bits_verdict(2000, 2), count);
      expect_verdict(client, pdu_of(2, {address, quantity}), bits_verdict(2000, 63), count);
      Bytes pdu = pdu_of(15, {address, quantity});
      const std::size_t bytes = std::min<std::size_t>((quantity + 7) / 8, 246);
      pdu.push_back(static_cast<std::uint8_t>(bytes));
      pdu.resize(pdu.size() + bytes);
      const int verdict = bits_verdict(1968, 2);
      expect_verdict(client, pdu, verdict == 0 ? 6 : verdict, count);
    }
    expect_verdict(client, pdu_of(5, {address, 0}), address < 2 ? 6 : 2, count);
    expect_verdict(client, pdu_of(5, {address, 0xff00}), address < 2 ? 6 : 2, count);
  }
  EXPECT_GT(count, 1500u);
  RecordProperty("pdus", static_cast<int>(count));

  std::vector<Words> after = everything(client);
  EXPECT_EQ(bench.owner(), 0u);
  EXPECT_EQ(bench.newest().tick, 0u);
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (before[i].size() == 11) after[i][10] = before[i][10];  // the reason of the last refusal
    EXPECT_EQ(before[i], after[i]) << "block " << i;
  }
}

// Catches: a byte count that is believed, a coil that is half on, bits beyond the quantity.
TEST(Modbus, MB_03_CountsAndBitsThatDoNotFitAreRefused) {
  ModbusBench bench;
  Client client(bench.port());
  for (const std::uint8_t wrong : Bytes{0, 1, 3, 4, 255}) {
    Bytes pdu = write_pdu(400, {7});
    pdu[5] = wrong;
    EXPECT_EQ(client.ask(pdu), exception_pdu(16, 3)) << int{wrong};
    pdu = read_write_pdu(0, 1, 400, {7});
    pdu[9] = wrong;
    EXPECT_EQ(client.ask(pdu), exception_pdu(23, 3)) << int{wrong};
    EXPECT_EQ(client.ask({15, 0, 0, 0, 9, wrong, 0}), exception_pdu(15, 3)) << int{wrong};
  }
  for (const std::size_t value : Sizes{1, 0xff, 0xff01, 0xfe00, 0xffff})
    EXPECT_EQ(client.ask(pdu_of(5, {0, value})), exception_pdu(5, 3)) << value;
  for (const std::uint8_t bits : Bytes{0x04, 0x80, 0xff})
    EXPECT_EQ(client.ask({15, 0, 0, 0, 2, 1, bits}), exception_pdu(15, 3)) << int{bits};
  EXPECT_EQ(client.ask({15, 0, 0, 0, 2, 1, 0x03}), exception_pdu(15, 6)) << "the bits that were asked for";
  EXPECT_EQ(bench.owner(), 0u);
}

// Catches: a write that stops half way, the good half of an exchange carried out.
TEST(Modbus, MB_04_AWriteIsWholeOrDoesNotHappen) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  EXPECT_EQ(client.write(408, {0, 0, 0}), 2) << "partly outside";
  EXPECT_EQ(client.write(103, {5, 6}), 2) << "the second register is read-only";
  EXPECT_EQ(client.ask(read_write_pdu(600, 1, 402, {1})), exception_pdu(23, 2)) << "the read half is bad";
  EXPECT_EQ(client.ask(read_write_pdu(0, 1, 402, {9})), exception_pdu(23, 3)) << "the write half is bad";
  EXPECT_EQ(client.read(101, 3), (Words{0, 0, 0}));
  EXPECT_EQ(client.read(402, 7), (Words{0, 0, 0, 0, 0, 0, 0}));

  // Two parameters in one write, of which the second cannot be: R_S 2 ohm, then R_R below its minimum.
  const std::size_t length = 2 * parameters().size();
  const Words before = client.read_all(1000, length);
  EXPECT_EQ(client.write(1002, {0x4000, 0, 0, 0}), 3);
  // Coulomb friction above the static friction breaks a rule between two parameters.
  const std::size_t address = address_of("mechanics.viscous_friction_nms");
  EXPECT_EQ(client.write(address, {0x3a00, 0, 0x4000, 0}), 3) << "viscous friction, then Coulomb friction";
  EXPECT_EQ(client.read_all(1000, length), before);
  EXPECT_EQ(client.write(address, {0x3a00, 0}), 0) << "the first of them alone is fine";
  EXPECT_EQ(client.read(address, 2), (Words{0x3a00, 0}));

  // A lease that comes with a command that is refused does not stay.
  Client other(bench.port());
  ASSERT_EQ(client.write(401, {2}), 0);
  Words all{9, 0};
  const Words stale = command_words(1, 77, 0.0f, 0.0f);
  all.insert(all.end(), stale.begin(), stale.end());
  EXPECT_EQ(other.write(400, all), 4) << "answers a sample that has not been taken";
  EXPECT_EQ(bench.owner(), 0u);
  EXPECT_EQ(other.read_one(409), 0);
}

// Catches: a unit id that reaches the wrong axis, or an axis that does not exist answered by another.
TEST(Modbus, MB_07_TheUnitIdIsTheAxis) {
  ModbusBench bench(modbus_bench_config(2));
  Client client(bench.port());
  for (const std::uint8_t unit : Bytes{0, 1, 255})
    EXPECT_EQ(client.read(2, 2, unit), (Words{2, 0})) << int{unit};
  EXPECT_EQ(client.read(2, 2, 2), (Words{2, 1}));
  for (const std::uint8_t unit : Bytes{3, 64, 100, 247, 248, 254}) {
    EXPECT_EQ(client.ask(pdu_of(3, {0, 1}), unit), exception_pdu(3, 11)) << int{unit};
    EXPECT_EQ(client.ask(write_pdu(400, {1}), unit), exception_pdu(16, 11)) << int{unit};
  }
  ASSERT_EQ(client.write(400, {5}, 2), 0);
  EXPECT_EQ(bench.owner(0), 0u);
  EXPECT_NE(bench.owner(1), 0u);
}

// Catches: NaN or Inf that reaches the bench, a value out of range, a read-only register that takes a value.
TEST(Modbus, MB_12_AnInvalidValueIsRefused) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const float inf = std::numeric_limits<float>::infinity();
  std::uint64_t refused = 0;
  for (const float bad : {std::nanf(""), std::nanf("5"), inf, -inf, 1.1e6f, -3e38f}) {
    for (const bool in_a : {true, false}) {
      EXPECT_TRUE(client.exchange(1, 0, in_a ? bad : 0.0f, in_a ? 0.0f : bad).empty());
      EXPECT_EQ(client.last_exception(), 3) << bad;
      ++refused;
    }
  }
  EXPECT_TRUE(client.exchange(3, 0, 1.01f, 0.0f).empty()) << "a duty above 1";
  EXPECT_EQ(client.last_exception(), 3);
  ++refused;
  EXPECT_TRUE(client.exchange(6, 0, 0.0f, 0.0f).empty()) << "a mode that does not exist";
  ++refused;
  EXPECT_EQ(client.write(401, {4}), 3) << "a request that does not exist";
  EXPECT_EQ(client.write(1002, {0x7fc0, 0}), 3) << "NaN as a resistance";
  EXPECT_EQ(client.write(1002, {0xbf80, 0}), 3) << "a negative resistance";
  EXPECT_EQ(client.write(1000, {0x4040, 0}), 2) << "pole pairs cannot change while running";
  for (const std::size_t address : Sizes{0, 18, 100, 104, 112, 200, 285, 409, 410})
    EXPECT_EQ(client.ask(pdu_of(6, {address, 1})), exception_pdu(6, 2)) << address;
  EXPECT_EQ(bench.newest().tick, 0u);
  // Legal, if odd: -0.0 and a denormal arrive bit for bit. And all that was refused has been counted.
  EXPECT_FALSE(client.exchange(1, 0, -0.0f, std::bit_cast<float>(1u)).empty());
  EXPECT_EQ(bench.newest().refused_commands, refused);
  EXPECT_EQ(client.read(405, 4), (Words{0x8000, 0, 0, 1}));
}

// Catches: a whole-number parameter that takes a fraction.
TEST(Modbus, MB_12_SwitchesTakeZeroAndOne) {
  ModbusBench bench;
  Client client(bench.port());
  ASSERT_EQ(client.write(400, {7}), 0);
  const std::size_t trip = address_of("amplifier.over_current_trip");
  EXPECT_EQ(client.write(trip, {0x3f00, 0}), 3) << "0.5";
  EXPECT_EQ(client.write(trip, {0, 0}), 0);
  EXPECT_EQ(client.write(trip + 10'000, {0, 0x3f80}), 0) << "1, in the mirror";
  EXPECT_EQ(client.read(trip, 2), (Words{0x3f80, 0}));
}

// Catches: writes that get through although the configuration forbids them.
TEST(Modbus, WithoutPermissionEveryRegisterIsReadOnly) {
  BenchConfig config = modbus_bench_config();
  config.modbus.allow_writes = false;
  ModbusBench bench(config);
  Client client(bench.port());
  EXPECT_EQ(client.read_one(27), 0);
  EXPECT_EQ(client.write(400, {7}), 2);
  EXPECT_EQ(client.ask(pdu_of(6, {400, 7})), exception_pdu(6, 2));
  EXPECT_EQ(client.ask(pdu_of(22, {400, 0, 7})), exception_pdu(22, 2));
  EXPECT_EQ(client.ask(pdu_of(5, {0, 0xff00})), exception_pdu(5, 2));
  EXPECT_EQ(client.ask({15, 0, 0, 0, 1, 1, 1}), exception_pdu(15, 2));
  EXPECT_EQ(client.ask(read_write_pdu(0, 1, 400, {7})), exception_pdu(23, 2));
  EXPECT_EQ(bench.owner(), 0u);
}

}  // namespace
}  // namespace drivebench::modbus::requests_test
