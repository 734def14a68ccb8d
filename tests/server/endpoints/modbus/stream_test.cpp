// Frames, floods and slow peers: MB-05, MB-06, MB-08 to MB-10 and MB-14 of the list of faults.
#include <fcntl.h>
#include <sys/resource.h>

#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::stream_test {
namespace {

const Bytes kReadMarker = pdu_of(3, {0, 1});

bool still_serves(ModbusBench& bench) {
  Client other(bench.port());
  return other.read_one(0) == kMarker;
}

// Catches: a length that is believed, a server that looks for the next frame in the middle of a bad one; the
// tail of a frame that is carried out as a request of its own.
TEST(Modbus, MB_05_AWrongLengthEndsTheConnection) {
  ModbusBench bench;
  for (const std::size_t length : Sizes{0, 1, 255, 256, 65535}) {
    Client client(bench.port());
    Bytes adu = adu_of(1, 1, kReadMarker);
    adu[4] = static_cast<std::uint8_t>(length >> 8);
    adu[5] = static_cast<std::uint8_t>(length);
    adu.resize(400);
    client.send(adu);
    EXPECT_TRUE(client.is_closed()) << length;
  }
  {
    Client client(bench.port());
    EXPECT_EQ(client.ask({7}), exception_pdu(7, 1)) << "2 is the shortest";
    Bytes longest(253);
    longest[0] = 8;
    EXPECT_EQ(client.ask(longest), longest) << "254 is the longest";
  }
  {
    Client owner(bench.port());
    ASSERT_EQ(owner.write(400, {7}), 0);
    // One frame of length 18 whose body is a read of 6 bytes and then a whole frame that gives the lease
    // back.
    Bytes body = kReadMarker;
    const Bytes smuggled = adu_of(2, 1, pdu_of(6, {400, 0}));
    body.insert(body.end(), smuggled.begin(), smuggled.end());
    owner.send(adu_of(1, 1, body));
    EXPECT_TRUE(owner.is_closed());
    EXPECT_NE(bench.owner(), 0u) << "the tail was not carried out";
  }
  for (const Bytes& pdu : std::vector<Bytes>{{3, 0, 0, 0},
                                             {3, 0, 0, 0, 1, 0},
                                             {6, 0, 0},
                                             {5, 0, 0, 0, 0, 0},
                                             {16, 0, 0, 0, 1, 2, 0},
                                             {16, 0, 0, 0, 1, 2, 0, 0, 0},
                                             {15, 0, 0, 0, 1},
                                             {22, 0, 0},
                                             {23, 0, 0, 0, 1, 0, 0, 0, 1},
                                             {8, 0},
                                             {43},
                                             {43, 14, 1}}) {
    Client client(bench.port());
    client.send(adu_of(1, 1, pdu));
    EXPECT_TRUE(client.is_closed()) << "function " << int{pdu[0]};
  }
  EXPECT_TRUE(still_serves(bench));
  EXPECT_EQ(bench.count("cut"), 5u + 1u + 12u);
}

// Catches: another protocol taken for Modbus.
TEST(Modbus, MB_06_AnotherProtocolIsNotAnswered) {
  ModbusBench bench;
  for (const std::size_t at : Sizes{2, 3}) {
    Client client(bench.port());
    Bytes adu = adu_of(1, 1, kReadMarker);
    adu[at] = 1;
    client.send(adu);
    EXPECT_TRUE(client.is_closed());
  }
  for (const std::string text :
       {"GET / HTTP/1.0\r\n\r\n", "SSH-2.0-x\r\n", "\x16\x03\x01\x02\x01\x01\x01\x01\xfc"}) {
    Client client(bench.port());
    client.send({text.begin(), text.end()});
    EXPECT_TRUE(client.is_closed());
  }
  EXPECT_TRUE(still_serves(bench));
}

// Catches: answers out of order or lost, a frame that depends on how the stream was cut.
TEST(Modbus, MB_08_PipelinedRequestsAreAnsweredInOrder) {
  ModbusBench bench;
  Client client(bench.port());
  Bytes stream;
  for (std::uint16_t i = 0; i < 64; ++i) {
    const Bytes adu =
        adu_of(static_cast<std::uint16_t>(1000 + i), 1, pdu_of(3, {i % 4 == 3 ? 600u : 2u + i % 4, 1}));
    stream.insert(stream.end(), adu.begin(), adu.end());
  }
  const auto expect_answers = [&client] {
    for (std::uint16_t i = 0; i < 64; ++i) {
      const Bytes answer = client.receive_adu();
      ASSERT_GT(answer.size(), 8u);
      EXPECT_EQ(answer[0] << 8 | answer[1], 1000 + i);
      EXPECT_EQ(answer[7], i % 4 == 3 ? 0x83 : 3);
    }
  };
  client.send(stream);
  expect_answers();
  // Cut at every byte of the first two frames, the rest in one piece.
  for (std::size_t cut = 1; cut < 24; ++cut) {
    client.send({stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(cut)});
    client.send({stream.begin() + static_cast<std::ptrdiff_t>(cut), stream.end()});
    expect_answers();
  }
  for (const std::uint8_t byte : stream)
    client.send({byte});
  expect_answers();
}

// Catches: a peer that floods and starves the others, or is served for ever; a limit that an honest owner
// meets.
TEST(Modbus, MB_09_LIMIT_06_AFloodIsRefusedAndThenCut) {
  BenchConfig config = modbus_bench_config();
  config.modbus.requests_per_s = 100;
  ModbusBench bench(config);
  Bytes flood;
  for (std::uint16_t i = 0; i < 2000; ++i) {
    const Bytes adu = adu_of(i, 1, pdu_of(7, {}));
    flood.insert(flood.end(), adu.begin(), adu.end());
  }
  std::vector<std::unique_ptr<Client>> flooders;
  for (int i = 2; i < 18; ++i) {
    flooders.push_back(std::make_unique<Client>(bench.port(), ("127.0.0." + std::to_string(i)).c_str()));
    flooders.back()->send(flood);
  }
  // The owner, on an address of its own, goes through many more exchanges than its bucket has tokens.
  Client owner(bench.port());
  ASSERT_EQ(owner.write(400, {7}), 0);
  for (std::uint32_t tick = 0; tick < 500; ++tick)
    ASSERT_FALSE(owner.exchange(1, tick, 1.0f, 0.0f).empty()) << tick << ": " << owner.last_exception();
  for (const auto& flooder : flooders) {
    int served = 0;
    int refused = 0;
    for (Bytes answer = flooder->receive_adu(); !answer.empty(); answer = flooder->receive_adu()) {
      served += answer[8] == 1 ? 1 : 0;
      refused += answer[8] == 6 ? 1 : 0;
    }
    EXPECT_GE(served, 100);
    EXPECT_LT(served + refused, 2000) << "it ends before the flood does";
  }
  EXPECT_EQ(bench.count("cut"), 16u);
  EXPECT_GE(bench.count("throttled"), 16u * 50);
  EXPECT_EQ(bench.newest().missed_commands, 0u);
  EXPECT_EQ(bench.newest().tick, 500u);
}

// Catches: a time-out that is not the configured one.
TEST(Modbus, LIMIT_06_AFrameInTwoPiecesIsAnsweredWithinItsTime) {
  BenchConfig config = modbus_bench_config();
  config.modbus.frame_timeout_ms = 5000;
  ModbusBench bench(config);
  Client slow(bench.port());
  const Bytes adu = adu_of(3, 1, pdu_of(3, {0, 1}));
  slow.send(Bytes(adu.begin(), adu.begin() + 5));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  slow.send(Bytes(adu.begin() + 5, adu.end()));
  EXPECT_FALSE(slow.receive_adu().empty());
  EXPECT_EQ(bench.count("cut"), 0u);
}

// Catches: a time-out that every byte starts anew, one that meets another connection, or none.
TEST(Modbus, MB_10_LIMIT_06_AFrameThatDripsIsCutOff) {
  BenchConfig config = modbus_bench_config();
  config.modbus.frame_timeout_ms = 50;
  ModbusBench bench(config);
  Client patient(bench.port());
  ASSERT_EQ(patient.read_one(0), kMarker);
  {
    Client silent(bench.port());
    silent.send({0, 1, 0, 0, 0});
    EXPECT_TRUE(silent.is_closed());
  }
  {
    Client dripping(bench.port());
    const Bytes adu = adu_of(1, 1, Bytes(253, 8));
    std::size_t sent = 0;
    while (sent < adu.size() && dripping.send({adu[sent]})) {
      ++sent;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_LT(sent, adu.size());
  }
  EXPECT_EQ(patient.read_one(0), kMarker) << "silence between frames is allowed";
  EXPECT_EQ(bench.count("cut"), 2u);
}

// Catches: a peer that does not read its answers and makes the server keep them all, or wait for it.
TEST(Modbus, MB_10_APeerThatTakesNothingIsCutOff) {
  BenchConfig config = modbus_bench_config();
  config.modbus.frame_timeout_ms = 500;
  ModbusBench bench(config);
  Client deaf(bench.port());
  Bytes requests;
  for (std::uint16_t i = 0; i < 1000; ++i) {
    const Bytes adu = adu_of(i, 1, pdu_of(3, {200, 86}));
    requests.insert(requests.end(), adu.begin(), adu.end());
  }
  while (deaf.send(requests) && bench.count("cut") == 0)
    EXPECT_TRUE(still_serves(bench));
  bench.until([&] { return bench.count("cut") > 0; });
}

// Catches: connections beyond the cap that are kept, or that push out a connection that is at work.
TEST(Modbus, AFullServerRefusesAClientOrCutsAnIdleOne) {
  BenchConfig config = modbus_bench_config();
  config.modbus.max_connections = 2;
  config.modbus.idle_timeout_ms = 1'000'000;
  {
    ModbusBench bench(config);
    Client first(bench.port());
    Client second(bench.port());
    ASSERT_EQ(first.read_one(0), kMarker);
    ASSERT_EQ(second.read_one(0), kMarker);
    Client third(bench.port());
    EXPECT_TRUE(third.is_closed());
    EXPECT_EQ(first.read_one(0), kMarker);
    EXPECT_EQ(bench.count("turned_away"), 1u);
    second.close();
    bench.until([&] { return bench.count("connections") == 1; });
    EXPECT_TRUE(still_serves(bench));
  }
  config.modbus.idle_timeout_ms = 0;  // every connection counts as idle at once
  ModbusBench bench(config);
  Client first(bench.port());
  ASSERT_EQ(first.read_one(0), kMarker);
  Client second(bench.port());
  ASSERT_EQ(second.read_one(0), kMarker);
  Client third(bench.port());
  EXPECT_EQ(third.read_one(0), kMarker);
  EXPECT_TRUE(first.is_closed()) << "the connection that was idle longest";
  EXPECT_EQ(second.read_one(0), kMarker);
}

// Catches: a descriptor above 1023 in a set of select().
TEST(Modbus, MB_14_ManyDescriptorsDoNoHarm) {
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit more{.rlim_cur = std::min<rlim_t>(limit.rlim_max, 4096), .rlim_max = limit.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &more), 0);
  if (more.rlim_cur < 1200) GTEST_SKIP() << "this system allows " << more.rlim_cur << " descriptors";
  ModbusBench bench;
  std::vector<int> many;
  for (int i = 0; i < 1100; ++i)
    many.push_back(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  EXPECT_GT(many.back(), 1024);
  {
    Client client(bench.port());
    EXPECT_EQ(client.read_one(0), kMarker);
    ASSERT_EQ(client.write(400, {7}), 0);
    EXPECT_EQ(client.exchange(1, 0, 1.0f, 0.0f).size(), kSampleLength);
    EXPECT_EQ(client.ask(pdu_of(3, {0, 0})), exception_pdu(3, 3));
    EXPECT_THROW(ReplyBuilder{}, std::runtime_error)
        << "libmodbus gets no descriptor that it could select on";
  }
  for (const int descriptor : many)
    ::close(descriptor);
  EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
}

}  // namespace
}  // namespace drivebench::modbus::stream_test
