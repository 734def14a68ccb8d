#include "clients/command/common/programs/process.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <optional>

#include "clients/command/common/programs/server_ready.hpp"

namespace drivebench::command::process_test {
namespace {

using namespace std::chrono_literals;

// Catches: a lost line, a wrong exit code, and a signal that looks like success.
TEST(Process, GivesLinesAndTheExitCode) {
  Process echo({"/bin/sh", "-c", "printf 'one\\ntwo\\n'; exit 7"});
  EXPECT_EQ(echo.read_line(Process::in(10s)), "one");
  EXPECT_EQ(echo.read_line(Process::in(10s)), "two");
  EXPECT_EQ(echo.read_line(Process::in(10s)), std::nullopt);
  EXPECT_EQ(echo.wait(Process::in(10s)), 7);

  Process sleeper({"/bin/sleep", "1000"});
  EXPECT_EQ(sleeper.read_line(Process::in(1ms)), std::nullopt);
  EXPECT_EQ(sleeper.wait(Process::in(1ms)), std::nullopt);
  sleeper.terminate();
  EXPECT_EQ(sleeper.wait(Process::in(10s)), 128 + SIGTERM);

  Process missing({"/nowhere/program"});
  EXPECT_EQ(missing.wait(Process::in(10s)), 127);
}

// Catches: a line of another kind, or no JSON at all, that passes for the server's.
TEST(ServerReady, ReadsOnlyTheServersOwnLines) {
  const std::string ready =
      R"({"event":"ready","tcp":"127.0.0.1:7300","can":[],"modbus":"","unix":"","mode":"lockstep","bench":"servo"})";
  ASSERT_TRUE(parse_ready(ready).has_value());
  EXPECT_EQ(parse_ready(ready)->tcp, "127.0.0.1:7300");
  for (const char* line : {"", "ready", "[]", "{}", R"({"event":"ready"})", R"({"event":5,"tcp":""})",
                           R"({"event":"verdict","tcp":"a","mode":"b","bench":"c"})"}) {
    EXPECT_FALSE(parse_ready(line).has_value()) << line;
  }
}

}  // namespace
}  // namespace drivebench::command::process_test
