#include "server/config/grants.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <string>
#include <vector>

#include "protocols/document.hpp"
#include "server/host/wall_time.hpp"
#include "tests/server/access/instruction_path.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::grants_test {
namespace {

using std::chrono::sys_seconds;

sys_seconds at(std::int64_t seconds) {
  return sys_seconds(std::chrono::seconds(seconds));
}

// Catches: a time zone with the wrong sign, and texts that are no time but read as one.
TEST(WallTime, OWN_07_ReadsTimesOfRfc3339AndNothingElse) {
  EXPECT_EQ(parse_rfc3339("1970-01-02T00:00:01Z"), at(86401));
  EXPECT_EQ(parse_rfc3339("2026-11-22T18:00:00Z"), at(1'795'370'400));  // date -d ... +%s
  EXPECT_EQ(parse_rfc3339("2026-11-22T18:00:00+01:30"), at(1'795'370'400 - 5400));
  EXPECT_EQ(parse_rfc3339("2026-11-22T18:00:00-00:30"), at(1'795'370'400 + 1800));
  EXPECT_EQ(parse_rfc3339("2024-02-29T23:59:59Z"), at(1'709'251'199));
  for (const char* const wrong :
       {"", "2026-11-22", "2026-11-22T18:00:00", "2026-11-22 18:00:00Z", "2025-02-29T00:00:00Z",
        "2026-13-01T00:00:00Z", "2026-11-22T24:00:00Z", "2026-11-22T18:60:00Z", "2026-11-22T18:00:60Z",
        "2026-11-22T18:00:00.5Z", "2026-11-22T18:00:00Zx", "2026-11-22T18:00:00+24:00",
        "2026-11-22T18:00:00+1:00", "-026-11-22T18:00:00Z", "2026-11-22T+8:00:00Z", "1969-12-31T23:59:59Z",
        "9999-01-01T00:00:00Z", "tomorrow"}) {
    EXPECT_FALSE(parse_rfc3339(wrong)) << wrong;
  }
}

// Catches: a log that writes local time, or microseconds without their zeros.
TEST(WallTime, WritesUtcWithMicroseconds) {
  EXPECT_EQ(rfc3339(at(1'795'370'400) + std::chrono::microseconds(42)), "2026-11-22T18:00:00.000042Z");
}

std::string problems_of_tokens(const std::filesystem::path& file) {
  try {
    load_grants(file);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "none";
}

// Catches: a token stored in plain, and a hash that differs from that of sha256sum.
TEST(Grants, ATokenAndItsHashGiveTheSameGrant) {
  const Folder folder;
  const std::filesystem::path file =
      folder.write("tokens.toml",
                   "[[token]]\nname = 'anna'\nrole = 'admin'\ntoken = 'open sesame'\n"
                   "until = '2026-11-22T18:00:00Z'\n"
                   "[[token]]\nname = 'ben'\nrole = 'viewer'\nrevoked = true\n"
                   "sha256 = 'ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad'\n");
  ::chmod(file.c_str(), 0600);
  const std::vector<Grant> grants = load_grants(file);
  ASSERT_EQ(grants.size(), 2u);
  EXPECT_EQ(grants[0].name, "anna");
  EXPECT_EQ(grants[0].role, Role::kAdmin);
  EXPECT_EQ(grants[0].until, at(1'795'370'400));
  EXPECT_EQ(find_grant(grants, "open sesame"), &grants[0]);
  EXPECT_EQ(find_grant(grants, "abc"), &grants[1]) << "the example of FIPS 180";
  EXPECT_TRUE(grants[0].holds_at(at(1'795'370'399)));
  EXPECT_FALSE(grants[0].holds_at(at(1'795'370'400)));
  EXPECT_FALSE(grants[1].holds_at(at(0))) << "revoked";
}

// Catches: a comparison that ends with the shorter text, or that takes a hash for its token.
TEST(Grants, SEC_04_ATokenThatIsNearlyRightIsWrong) {
  const std::string token = "correct-horse-battery-staple";
  const std::vector<Grant> grants{{.name = "anna", .role = Role::kOperator, .hash = hash_of_token(token)},
                                  {.name = "none", .role = Role::kAdmin, .hash = hash_of_token("")}};
  EXPECT_EQ(find_grant(grants, token), &grants[0]);
  for (std::size_t i = 0; i < token.size(); ++i) {
    std::string other = token;
    other[i] = static_cast<char>(other[i] ^ 1);
    EXPECT_EQ(find_grant(grants, other), nullptr) << other;
    EXPECT_NE(find_grant(grants, token.substr(0, i)), &grants[0]);
  }
  EXPECT_EQ(find_grant(grants, token + '\0'), nullptr);
  const TokenHash& hash = grants[0].hash;
  EXPECT_EQ(find_grant(grants, {reinterpret_cast<const char*>(hash.data()), hash.size()}), nullptr);
}

// Catches: a comparison whose time tells a guesser how many bytes of a token are right, or of which entry.
// Time is not measured: the program must execute the same instructions.
TEST(Grants, SEC_04_EveryWrongTokenTakesTheSameInstructions) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the thread sanitizer changes the instructions each time";
#endif
  const std::string token = "correct-horse-battery-staple";
  const TokenHash hash = hash_of_token(token);
  TokenHash far = hash;
  for (unsigned char& byte : far)
    byte = static_cast<unsigned char>(byte ^ 0xff);
  volatile bool sink =
      find_grant({}, token) != nullptr;  // binds the functions that are bound on their first call
  std::vector<Grant> grants(3, Grant{.name = "anna", .hash = far});
  const auto path = [&] { return instruction_path([&] { sink = find_grant(grants, token) != nullptr; }); };
  const auto expected = path();
  if (!expected) GTEST_SKIP() << "no single steps here";
  EXPECT_EQ(path(), expected) << "the list of instructions varies by itself";
  for (const std::size_t right : {0u, 1u, 15u, 31u}) {
    TokenHash near = far;  // its first bytes are right
    std::copy_n(hash.begin(), right, near.begin());
    grants[right % 3].hash = near;
    EXPECT_EQ(path(), expected) << right << " bytes are right";
    near = hash;  // one bit is wrong
    near[right] = static_cast<unsigned char>(near[right] ^ 1u << right % 8);
    grants[right % 3].hash = near;
    EXPECT_EQ(path(), expected) << "but for a bit in byte " << right;
    grants[right % 3].hash = far;
  }
  // A right token ends no search early.
  grants[0].hash = hash;
  const auto first = path();
  grants[0].hash = far;
  grants[2].hash = hash;
  EXPECT_EQ(path()->count, first->count);

  // The test sees a comparison that stops at the first wrong byte.
  const auto naive = [&](std::size_t right) {
    TokenHash near = far;
    std::copy_n(hash.begin(), right, near.begin());
    return instruction_path([&] {
      std::size_t same = 0;
      while (same < hash.size() && near[same] == hash[same])
        ++same;
      sink = same == hash.size();
    });
  };
  EXPECT_LT(naive(3)->count, naive(30)->count);
}

// Catches: a file of tokens that every user can read, and a message that contains a token.
TEST(Grants, SEC_04_AWrongFileIsRefusedWithoutNamingItsTokens) {
  const Folder folder;
  const std::string entry = "[[token]]\nname = 'anna'\nrole = 'viewer'\ntoken = 'open sesame'\n";
  const std::filesystem::path file = folder.write("tokens.toml", entry);
  for (const unsigned mode : {0640u, 0604u, 0660u}) {
    ::chmod(file.c_str(), mode);
    EXPECT_NE(problems_of_tokens(file).find("chmod 600"), std::string::npos) << mode;
  }
  ::chmod(file.c_str(), 0600);
  EXPECT_EQ(problems_of_tokens(file), "none");
  EXPECT_NE(problems_of_tokens(folder.path()).find("is a directory"), std::string::npos);
  EXPECT_NE(problems_of_tokens("/dev/null").find("not a regular file"), std::string::npos);
  EXPECT_NE(problems_of_tokens(folder.path() / "nothing"), "none");
  const auto after = [&](const std::string& text) {
    folder.write("tokens.toml", text);
    const std::string found = problems_of_tokens(file);
    EXPECT_EQ(found.find("sesame"), std::string::npos) << found;
    return found;
  };
  EXPECT_NE(after(""), "none");
  EXPECT_NE(after(entry + "sha256 = 'ab'\n").find("one of them"), std::string::npos);
  EXPECT_NE(after(entry + entry).find("another entry"), std::string::npos);
  EXPECT_NE(after(entry + "until = 'tomorrow'\n").find("must be a time"), std::string::npos);
  EXPECT_NE(after(entry + "roles = 'x'\n").find("not a known key"), std::string::npos);
  EXPECT_NE(after("[[token]]\nname = 'a'\nrole = 'king'\ntoken = 'open sesame'\n").find("admin"),
            std::string::npos);
  EXPECT_NE(after("[[token]]\nname = 'a'\nrole = 'viewer'\nsha256 = 'open sesame'\n").find("64"),
            std::string::npos);
  EXPECT_NE(after("[[token]]\nname = 'a'\nrole = 'viewer'\ntoken = \"open sesame\\u00e4\"\n").find("ASCII"),
            std::string::npos);
  EXPECT_NE(after("[[token]]\nname = 'a'\nrole = 'viewer'\n").find("one of them"), std::string::npos);
}

}  // namespace
}  // namespace drivebench::test::grants_test
