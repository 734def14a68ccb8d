#include "clients/link/common/address.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

namespace drivebench::link::address_test {
namespace {

using namespace std::chrono_literals;

std::string round_trip(std::string_view text) {
  return to_string(parse_address(text));
}

// Catches: a form of address that is taken apart at the wrong place.
TEST(Address, ReadsEveryForm) {
  EXPECT_EQ(round_trip("tcp:127.0.0.1:7300"), "tcp:127.0.0.1:7300");
  EXPECT_EQ(round_trip("127.0.0.1:81"), "tcp:127.0.0.1:81");
  EXPECT_EQ(round_trip("localhost"), "tcp:localhost:7300");
  EXPECT_EQ(round_trip("[::1]:81"), "tcp:[::1]:81");
  EXPECT_EQ(round_trip("tcp:[::1]"), "tcp:[::1]:7300");
  EXPECT_EQ(round_trip("unix:/run/a:b"), "unix:/run/a:b");
  EXPECT_EQ(round_trip("tls:bench"), "tls:bench:7300");
  const Address secure = parse_address("tls:[::1]:81?ca=/a b/ca.pem&certificate=c.pem&key=k.pem");
  EXPECT_EQ(to_string(secure), "tls:[::1]:81");
  EXPECT_EQ(secure.files.ca, "/a b/ca.pem");
  EXPECT_EQ(secure.files.certificate, "c.pem");
  EXPECT_EQ(secure.files.key, "k.pem");
  EXPECT_FALSE(parse_address("tcp:bench").tls);
  EXPECT_EQ(round_trip("shm:/run/a:b"), "shm:/run/a:b");
  const Address shared = parse_address("shm:/run/a?b?spin_us=100");
  EXPECT_EQ(shared.path, "/run/a?b");
  EXPECT_EQ(shared.spin, 100us);
  EXPECT_TRUE(shared.shares_memory);
  EXPECT_EQ(parse_address("shm:/run/a").spin, 20us);
  EXPECT_FALSE(parse_address("unix:/run/a").shares_memory);
  const Address looking = parse_address("unix:/run/a?b?spin_us=1000");
  EXPECT_EQ(looking.path, "/run/a?b");
  EXPECT_EQ(looking.spin, 1000us);
  EXPECT_EQ(parse_address("unix:/run/a?b").path, "/run/a?b");
  EXPECT_EQ(parse_address("unix:/run/a?b").spin, 0us);
  EXPECT_EQ(round_trip("tcp:[::1]:81?spin_us=5"), "tcp:[::1]:81");
  EXPECT_EQ(parse_address("tcp:[::1]:81?spin_us=5").spin, 5us);
  EXPECT_EQ(parse_address("bench?spin_us=0").port, "7300");
}

// Catches: an address that would connect somewhere else than written, or a path that is cut off.
TEST(Address, RefusesInvalidTexts) {
  for (const std::string text : {"",
                                 "tcp:",
                                 ":7300",
                                 "host:",
                                 "host:0",
                                 "host:65536",
                                 "host:12x",
                                 "unix:",
                                 "/run/bench.sock",
                                 "my-bench.toml",
                                 "http://host:80",
                                 "tls:",
                                 "tls:a?ca=",
                                 "tls:a?b=c",
                                 "tls:a?key=k",
                                 "tls:a?certificate=c&ca=d",
                                 "tcp:a?ca=b",
                                 "tcp:a?spin_us=1001",
                                 "a:81?spin_us=",
                                 "tls:a?spin_us=1",
                                 "unix:/a?spin_us=1001",
                                 "unix:/a?spin_us=1?b",
                                 "shm:",
                                 "shm:?spin_us=1",
                                 "shm:/a?spin=5",
                                 "shm:/a?spin_us=",
                                 "shm:/a?spin_us=101",
                                 "shm:/a?spin_us=-1",
                                 "shm:/a?spin_us=1x"}) {
    EXPECT_THROW(parse_address(text), AddressError) << text;
  }
  EXPECT_THROW(parse_address("unix:/" + std::string(107, 'a')), AddressError);
  EXPECT_NO_THROW(parse_address("unix:/" + std::string(106, 'a')));
}

// Catches: a connection that is reported as made when nothing listens, and a socket left non-blocking.
TEST(Address, ConnectsOnlyToAListeningSocket) {
  const FileDescriptor listener(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in here = {};
  here.sin_family = AF_INET;
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof here;
  ASSERT_EQ(::bind(listener.get(), reinterpret_cast<const sockaddr*>(&here), size), 0);
  ASSERT_EQ(::getsockname(listener.get(), reinterpret_cast<sockaddr*>(&here), &size), 0);
  const Address address = parse_address("127.0.0.1:" + std::to_string(ntohs(here.sin_port)));
  EXPECT_THROW(connect_to(address, 1s), ConnectError);
  ASSERT_EQ(::listen(listener.get(), 1), 0);
  const FileDescriptor connected = connect_to(address, 1s);
  ASSERT_TRUE(connected.is_open());
  EXPECT_EQ(::fcntl(connected.get(), F_GETFL) & O_NONBLOCK, 0);
  EXPECT_THROW(connect_to(parse_address("unix:/nowhere/bench.sock"), 1s), ConnectError);
}

}  // namespace
}  // namespace drivebench::link::address_test
