#include "clients/web/gateway/doors/door.hpp"

#include <gtest/gtest.h>

#include <string>

namespace drivebench::web::door_test {
namespace {

Door local_door() {
  return {.address = parse_listen_address("127.0.0.1:7380"), .tls = false, .token = {}};
}

Door guarded_door() {
  return {.address = parse_listen_address("0.0.0.0:443"), .tls = true, .token = "0123456789abcdef"};
}

std::string name_of(const Door& door, const Visitor& visitor) {
  const auto refusal = refusal_of(door, visitor);
  return std::string(refusal ? refusal->name : "in");
}

// Catches: DNS rebinding, where a foreign name leads to loopback; a port or a prefix that is not compared.
TEST(Door, WEB_01_OnLoopbackTheHostMustBeLoopback) {
  for (const char* host : {"127.0.0.1:7380", "localhost:7380", "LocalHost:7380", "[::1]:7380"}) {
    EXPECT_EQ(name_of(local_door(), {.host = host, .origin = {}, .authorization = {}}), "in") << host;
  }
  for (const char* host : {"", "evil.example:7380", "localhost", "localhost:7381",
                           "localhost:7380.evil.example", "127.0.0.1:73800", "127.0.0.1.evil.example:7380"}) {
    EXPECT_EQ(name_of(local_door(), {.host = host, .origin = {}, .authorization = {}}), "host") << host;
  }
}

// Catches: a WebSocket that a page of another site opens; an origin that only begins or ends like this page.
TEST(Door, WEB_01_TheOriginMustBeThisPage) {
  const auto named = [](const char* origin) {
    return name_of(local_door(), {.host = "localhost:7380", .origin = origin, .authorization = {}});
  };
  EXPECT_EQ(named(""), "in");
  EXPECT_EQ(named("http://localhost:7380"), "in");
  for (const char* origin :
       {"null", "http://evil.example", "https://localhost:7380", "http://localhost:7380.evil.example",
        "http://localhost:7381", "http://localhost", "localhost:7380", "file://"}) {
    EXPECT_EQ(named(origin), "origin") << origin;
  }
}

// Catches: an allowed site that comes in at the page's own socket, or one that only begins like an allowed
// site.
TEST(Door, WEB_06_AnAllowedSiteReadsThroughFoxglovesSocketAlone) {
  Door door = local_door();
  door.foxglove_origins = {"https://app.foxglove.dev", "file://"};
  const auto named = [&door](const char* origin, bool is_foxglove) {
    return name_of(
        door, {.host = "localhost:7380", .origin = origin, .authorization = {}, .is_foxglove = is_foxglove});
  };
  for (const char* origin : {"https://app.foxglove.dev", "HTTPS://App.Foxglove.dev", "file://"}) {
    EXPECT_EQ(named(origin, true), "in") << origin;
    EXPECT_EQ(named(origin, false), "origin") << origin;
  }
  for (const char* origin :
       {"http://app.foxglove.dev", "https://app.foxglove.dev.evil.example", "null", "file"})
    EXPECT_EQ(named(origin, true), "origin") << origin;
}

// Catches: a pattern or an address that is taken for an origin and never matches.
TEST(Door, AnOriginHasASchemeAHostAndNoPath) {
  for (const char* origin :
       {"https://app.foxglove.dev", "http://localhost:8080", "http://[::1]:80", "file://"})
    EXPECT_TRUE(is_origin(origin)) << origin;
  for (const char* other :
       {"", "*", "https://*.foxglove.dev", "app.foxglove.dev", "://a", "https://", "https://a/", "file:///x"})
    EXPECT_FALSE(is_origin(other)) << other;
}

// Catches: a token that is compared in part or in the wrong scheme, or that a user name replaces.
TEST(Door, WEB_02_TheTokenIsBearerOrThePasswordOfBasic) {
  const auto named = [](const char* authorization) {
    return name_of(guarded_door(), {.host = "bench.example", .origin = {}, .authorization = authorization});
  };
  EXPECT_EQ(named("Bearer 0123456789abcdef"), "in");
  EXPECT_EQ(named("basic YW5uYTowMTIzNDU2Nzg5YWJjZGVm"), "in");  // anna:0123456789abcdef
  EXPECT_EQ(named("Basic OjAxMjM0NTY3ODlhYmNkZWY="), "in");      // :0123456789abcdef
  for (const char* wrong : {"", "Bearer", "Bearer ", "Bearer 0123456789abcdeF", "Bearer 0123456789abcde",
                            "Bearer 0123456789abcdef0", "0123456789abcdef", "Basic 0123456789abcdef",
                            "Basic MDEyMzQ1Njc4OWFiY2RlZg==", "Basic ====", "Basic =", "Basic !",
                            "Basic MDEyMzQ1Njc4OWFiY2RlZjphbm5h"}) {
    EXPECT_EQ(named(wrong), "token") << wrong;
  }
  EXPECT_EQ(named(("Bearer " + std::string(100'000, 'a')).c_str()), "token");
}

// Catches: a form of address that is taken for loopback and is not, or is read at the wrong place.
TEST(ListenAddress, ReadsEveryFormAndRefusesTheRest) {
  EXPECT_EQ(to_string(parse_listen_address("127.0.0.1:7380")), "127.0.0.1:7380");
  EXPECT_EQ(to_string(parse_listen_address("localhost:0")), "127.0.0.1:0");
  EXPECT_EQ(to_string(parse_listen_address("[::1]:81")), "[::1]:81");
  EXPECT_TRUE(parse_listen_address("127.9.9.9:1").is_loopback);
  EXPECT_TRUE(parse_listen_address("[::1]:1").is_loopback);
  EXPECT_FALSE(parse_listen_address("0.0.0.0:1").is_loopback);
  EXPECT_FALSE(parse_listen_address("[::]:1").is_loopback);
  EXPECT_FALSE(parse_listen_address("128.0.0.1:1").is_loopback);
  for (const char* text :
       {"", "7380", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:80x", "bench:80",
        "::1:80", "[127.0.0.1]:80", "[::1:80", "127.1:80", ":80"}) {
    EXPECT_THROW(parse_listen_address(text), StartError) << text;
  }
}

}  // namespace
}  // namespace drivebench::web::door_test
