// Keys of leases that a client tries, and leases that change hands by a key.
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/server/endpoints/modbus/modbus_bench.hpp"

namespace drivebench::modbus::keys_test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t kKey = 4242;

/// A bench in lockstep whose clock stands still between the steps of a test; its owner never falls silent.
class Keys : public testing::Test {
 protected:
  static BenchConfig config() {
    BenchConfig config = modbus_bench_config();
    config.modbus.idle_timeout_ms = 86'400'000;
    return config;
  }
  Keys() { ServerClock::simulate(now_); }
  ~Keys() override { ServerClock::simulate(ServerClock::time_point(ServerClock::duration(-1))); }

  void pass(ServerClock::duration time) { ServerClock::simulate(now_ += time); }

  ServerClock::time_point now_{1000s};
};

/// Register 400 on: key, no request, and a command that starts with this mode.
Words with_key(std::uint16_t key, std::uint16_t mode = 1, float u_a = 1.0f) {
  Words words{key, 0};
  const Words command = command_words(mode, 0, u_a, 0.0f);
  words.insert(words.end(), command.begin(), command.end());
  return words;
}

// Catches: keys that can be tried as fast as the network allows, over one connection or many, in a write of
// the key alone, with a command, with a command that is refused for its values, or bit by bit.
TEST_F(Keys, MB_16_FourKeysAreReadAtOnce) {
  ModbusBench bench(config());
  Client owner(bench.port());
  ASSERT_EQ(owner.write(400, {kKey}), 0);
  std::uint16_t key = 1;
  while (key < 2 * kKey) {
    Client guesser(bench.port());
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(guesser.write(400, {key++}), 6);
      EXPECT_EQ(guesser.write(400, with_key(key++)), 6);
      EXPECT_EQ(guesser.write(400, with_key(key++, 3, 2.0f)), 3) << "a duty of 2";
      EXPECT_EQ(guesser.ask(pdu_of(22, {400, 0, key++})), exception_pdu(22, 6));
    }
  }
  EXPECT_EQ(bench.count("unread_keys"), key - 1u - 4u);
  EXPECT_EQ(bench.newest().refused_commands, 0u) << "none of the commands counted as the owner's";
  EXPECT_EQ(owner.read_one(400), kKey);
}

// Catches: a wait that does not grow, so that all keys are tried within a day.
TEST_F(Keys, MB_16_AnAddressReadsTwoKeysAMinute) {
  ModbusBench bench(config());
  Client owner(bench.port());
  ASSERT_EQ(owner.write(400, {kKey}), 0);
  Client guesser(bench.port(), "127.0.0.2");
  std::uint16_t tries = 0;
  for (int second = 0; second < 600; ++second) {
    EXPECT_EQ(guesser.write(400, {++tries}), 6);
    pass(1s);
  }
  const std::uint64_t read = tries - bench.count("unread_keys");
  EXPECT_GE(read, 25u);
  EXPECT_LE(read, 29u) << "three mistakes, at 3, 4, 5, 7, 11, 19, 35 s, and then every 30 s";
}

// Catches: an owner that a guesser locks out: on its own connection, from its own address, from another one;
// a program with a wrong key in its settings that counts as one that guesses.
TEST_F(Keys, MB_16_TheRightKeyIsStillTaken) {
  ModbusBench bench(config());
  Client owner(bench.port());
  ASSERT_EQ(owner.write(400, {kKey}), 0);
  Client guesser(bench.port());
  for (const std::uint16_t mistake : Words{11, 12, 13})
    EXPECT_EQ(guesser.write(400, {mistake}), 6);
  EXPECT_EQ(Client(bench.port()).write(400, {kKey}), 0) << "mistakes hold nobody up";
  EXPECT_EQ(owner.write(400, {kKey}), 0);
  EXPECT_EQ(guesser.write(400, {1}), 6);
  EXPECT_EQ(owner.write(400, {kKey}), 0) << "the connection that holds the lease never waits";
  EXPECT_EQ(owner.write(400, with_key(kKey)), 0);
  Client reconnected(bench.port());
  EXPECT_EQ(reconnected.write(400, {kKey}), 6) << "its address has to wait";
  Client elsewhere(bench.port(), "127.0.0.2");
  EXPECT_EQ(elsewhere.write(400, {kKey}), 0);
  pass(500ms);
  for (int i = 0; i < 10; ++i)
    EXPECT_EQ(guesser.write(400, {1}), 6) << "the same mistake";
  EXPECT_EQ(reconnected.write(400, {kKey}), 0);
  EXPECT_EQ(guesser.write(400, {2}), 6);
  EXPECT_EQ(owner.write(400, {kKey}), 6);
  pass(500ms);
  EXPECT_EQ(owner.write(400, {kKey}), 0) << "a right key has made the wait short again";
}

/// The lines of an audit log with this event.
std::vector<std::string> lines_of(const std::filesystem::path& file, const std::string& event) {
  std::vector<std::string> lines;
  std::ifstream text(file);
  for (std::string line; std::getline(text, line);) {
    if (line.find("\"event\":\"" + event + "\"") != std::string::npos) lines.push_back(line);
  }
  return lines;
}

// Catches: a lease that changes hands unseen; a log that two programs with one key fill, or that has a line
// for each request of a program that connects for each.
TEST_F(Keys, SEC_07_ATakeoverByTheKeyIsLogged) {
  const auto file =
      std::filesystem::temp_directory_path() / ("drivebench-keys-" + std::to_string(::getpid()));
  std::filesystem::remove(file);
  {
    Audit audit({.file = file});
    ModbusBench bench(config(), &audit);
    auto owner = std::make_unique<Client>(bench.port());
    ASSERT_EQ(owner->write(400, {kKey}), 0);
    for (int i = 0; i < 3; ++i) {
      owner.reset();
      bench.until([&] { return bench.count("connections") == 0; });
      owner = std::make_unique<Client>(bench.port());
      EXPECT_EQ(owner->write(400, {kKey}), 0) << "connects for each request";
    }
    EXPECT_EQ(lines_of(file, "take").size(), 0u);
    testing::internal::CaptureStderr();
    Client thief(bench.port(), "127.0.0.2");
    EXPECT_EQ(thief.write(400, {kKey}), 0);
    const std::string log = testing::internal::GetCapturedStderr();
    EXPECT_NE(log.find("took axis 0 from 127.0.0.1:"), std::string::npos) << log;
    ASSERT_EQ(lines_of(file, "take").size(), 1u);
    const std::string line = lines_of(file, "take")[0];
    EXPECT_NE(line.find("\"peer\":\"127.0.0.2:"), std::string::npos) << line;
    EXPECT_NE(line.find("\"from\":\"127.0.0.1:"), std::string::npos) << line;
    EXPECT_NE(line.find("\"axis\":\"axis0\""), std::string::npos) << line;
    for (int i = 0; i < 1000; ++i) {
      EXPECT_EQ(owner->write(400, {kKey}), 0);
      EXPECT_EQ(thief.write(400, {kKey}), 0);
    }
  }
  EXPECT_LE(lines_of(file, "take").size(), 2 * 100u) << "the budget of an address for an event";
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace drivebench::modbus::keys_test
