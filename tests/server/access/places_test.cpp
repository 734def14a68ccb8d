#include "server/access/places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "server/access/address.hpp"

namespace drivebench::places_test {
namespace {

const std::string kUnix(kUnixAddress);

/// Places, and what has become of each stranger.
class PlacesTest : public ::testing::Test {
 protected:
  Places::Number enter(const std::string& address) {
    const Places::Entry entry = places.enter(address);
    EXPECT_EQ(entry.number == 0, !entry.why_not.empty());
    places.on_displaced(entry.number, [this, number = entry.number](const std::string& why) {
      EXPECT_FALSE(why.empty());
      displaced.push_back(number);
      places.leave(number);  // as a session does when it is closed
    });
    return entry.number;
  }
  std::vector<Places::Number> enter(const std::string& address, std::size_t count) {
    std::vector<Places::Number> numbers;
    while (numbers.size() < count)
      numbers.push_back(enter(address));
    return numbers;
  }
  bool open(const std::string& address, Role role) {
    const Places::Number number = enter(address);
    const bool admitted = number != 0 && places.admit(number, role).empty();
    if (!admitted) places.leave(number);
    return admitted;
  }
  std::size_t open_all(const std::string& address, Role role) {
    std::size_t count = 0;
    while (open(address, role))
      ++count;
    return count;
  }

  Places places{{.sessions = 256, .sessions_of_address = 128}, true};
  std::vector<Places::Number> displaced;
};

// Catches: 32 silent sockets, renewed, that leave no room for another address or the unix socket; a newcomer
// that loses its place to the next of the crowd.
TEST_F(PlacesTest, TCP_13_LIMIT_02_ACrowdFromOneAddressDisplacesItselfOnly) {
  const std::vector<Places::Number> crowd = enter("192.0.2.1", Places::kStrangers);
  EXPECT_TRUE(displaced.empty()) << "32 have places";
  const Places::Number good = enter("192.0.2.2");
  const Places::Number local = enter(kUnix);
  EXPECT_EQ(displaced, (std::vector{crowd[0], crowd[1]})) << "the oldest of the crowd";
  enter("192.0.2.1", 1000);
  EXPECT_EQ(displaced.size(), 1002u) << "each of the crowd takes the place of another one";
  EXPECT_EQ(places.admit(good, Role::kViewer), "");
  EXPECT_EQ(places.admit(local, Role::kViewer), "");
}

// Catches: a crowd of silent peers that displaces one whose handshake or hello is under way, at one address
// as on loopback; one that has sent a byte and keeps its place for ever.
TEST_F(PlacesTest, SEC_05_SilentStrangersGoFirstAndTheOldestOfThem) {
  const Places::Number good = enter("127.0.0.1");
  places.heard(good);
  const std::vector<Places::Number> silent = enter("127.0.0.1", Places::kStrangers - 1);
  enter("127.0.0.1", 200);
  EXPECT_EQ(std::vector(displaced.begin(), displaced.begin() + 3),
            (std::vector{silent[0], silent[1], silent[2]}));
  EXPECT_EQ(displaced.size(), 200u);
  EXPECT_EQ(std::count(displaced.begin(), displaced.end(), good), 0);
  for (std::size_t n = 0; n < Places::kStrangers; ++n)
    places.heard(enter("127.0.0.1"));
  EXPECT_EQ(std::count(displaced.begin(), displaced.end(), good), 1);
  EXPECT_NE(places.admit(good, Role::kAdmin), "") << "it has no place any more";
}

// Catches: strangers from many addresses that push the unix socket out, or a crowd on it that keeps the
// network out.
TEST_F(PlacesTest, LIMIT_02_TheUnixSocketHasEightPlacesOfTheStrangers) {
  const std::vector<Places::Number> local = enter(kUnix, Places::kStrangers);
  const Places::Number first = enter("192.0.2.1");
  EXPECT_EQ(displaced, std::vector{local[0]});
  for (int n = 2; n < 200; ++n)
    enter("192.0.2." + std::to_string(n));
  for (std::size_t n = 0; n < Places::kStrangersOnUnix; ++n)
    EXPECT_EQ(places.admit(local[Places::kStrangers - 1 - n], Role::kViewer), "") << n;
  EXPECT_NE(places.admit(local[Places::kStrangers - 1 - Places::kStrangersOnUnix], Role::kViewer), "");
  EXPECT_NE(places.admit(first, Role::kViewer), "") << "of addresses with one each, the oldest goes";
}

// Catches: viewers that leave no place for an operator, or operators that leave none for the administrator
// that must take an axis by force; a reserve that has no end.
TEST_F(PlacesTest, OWN_04_LIMIT_02_EachRoleHasItsReserve) {
  EXPECT_EQ(open_all("192.0.2.1", Role::kViewer), 128u);
  EXPECT_EQ(open_all("192.0.2.2", Role::kViewer), 128u);
  EXPECT_FALSE(open("192.0.2.3", Role::kViewer));
  EXPECT_TRUE(open(kUnix, Role::kViewer));
  EXPECT_EQ(open_all("192.0.2.3", Role::kOperator), 7u);
  EXPECT_FALSE(open(kUnix, Role::kOperator));
  EXPECT_EQ(open_all("192.0.2.3", Role::kAdmin), 8u);
  EXPECT_EQ(enter("192.0.2.4"), 0u) << "no role would get a place";
}

// Catches: one address that takes the places of all; an administrator that a crowd at the same address keeps
// out; a place that is lost when its session ends.
TEST_F(PlacesTest, LIMIT_02_AnAddressHasAShareOfTheSessions) {
  std::vector<Places::Number> viewers = enter("192.0.2.1", 1);
  EXPECT_EQ(places.admit(viewers[0], Role::kViewer), "");
  EXPECT_EQ(open_all("192.0.2.1", Role::kViewer), 127u);
  EXPECT_TRUE(open("192.0.2.2", Role::kViewer));
  EXPECT_TRUE(open("192.0.2.1", Role::kOperator));
  EXPECT_TRUE(open("192.0.2.1", Role::kAdmin));
  EXPECT_EQ(open_all(kUnix, Role::kViewer), 125u + 8u) << "the unix socket is no address";
  for (int n = 0; n < 3; ++n)
    places.leave(viewers[0]);
  EXPECT_FALSE(open("192.0.2.1", Role::kViewer)) << "129 others are left";
}

struct Tokenless {
  const char* address;
  std::size_t sessions;
};

// Catches: a bench without tokens, where every session is an administrator, on which TCP takes the reserve of
// the unix socket; a number of sessions below the configured one.
TEST(Places, LIMIT_02_WithoutTokensTheReserveIsForTheUnixSocket) {
  for (const Tokenless& each : {Tokenless{"127.0.0.1", 3}, Tokenless{"unix", 3 + Places::kReserve}}) {
    Places places({.sessions = 3, .sessions_of_address = 3}, false);
    std::size_t sessions = 0;
    for (Places::Number n = 0; (n = places.enter(each.address).number) != 0; ++sessions)
      ASSERT_EQ(places.admit(n, Role::kAdmin), "");
    EXPECT_EQ(sessions, each.sessions) << each.address;
  }
}

// Catches: an IPv6 network whose every address is a new one; the port counted as part of the address.
TEST(Places, AnAddressIsThatOfAComputer) {
  const auto of = [](const char* transport, const char* peer) {
    return address_of({.transport = transport, .peer = peer, .subject = {}});
  };
  EXPECT_EQ(of("tcp", "192.0.2.1:5000"), "192.0.2.1");
  EXPECT_EQ(of("modbus", "192.0.2.1:6000"), "192.0.2.1");
  EXPECT_EQ(of("tcp", "2001:db8:1:2:3:4:5:6:5000"), "2001:db8:1:2::");
  EXPECT_EQ(of("tcp", "2001:db8:1:2:ffff:4:5:6:5000"), "2001:db8:1:2::");
  EXPECT_EQ(of("tcp", "::ffff:192.0.2.1:5000"), "192.0.2.1");
  EXPECT_EQ(of("unix", "process 12 of user 0"), "unix");
  EXPECT_EQ(of("can", "socketcan:vcan0 controller 3"), "can");
}

}  // namespace
}  // namespace drivebench::places_test
