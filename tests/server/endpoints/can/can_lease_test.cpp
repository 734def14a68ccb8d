// Leases over the CAN endpoint: the controller of an axis, its heartbeat and its silence.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/endpoints/can/endpoint.hpp"
#include "tests/server/endpoints/can/can_endpoint_test.hpp"

namespace drivebench::can::can_lease_test {
namespace {

// Catches: two controllers at once, on one bus or across transports; a lease number that two
// share.
TEST(CanLease, OWN_01_OneControllerAtATimeHoldsAnAxis) {
  CanBench bench;
  const std::uint8_t first = bench.acquire(1);
  ASSERT_NE(first, 0);
  EXPECT_EQ(bench.acquire(2), 0);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kOwned));
  EXPECT_EQ((*bench.newest(Message::kReply))["controller"], 2.0);
  EXPECT_EQ(bench.acquire(1), first) << "asked again: the reply may have been lost";
  bench.request(Request::kRelease, first, 1);
  EXPECT_EQ(bench.result(), 0.0);
  const std::uint8_t second = bench.acquire(2);
  EXPECT_NE(second, 0);
  EXPECT_NE(second, first) << "what the first one still sends must not count";
  bench.request(Request::kRelease, first, 1);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kNotOwner));
  bench.request(Request::kRelease, second, 2);

  std::optional<Refused> elsewhere;  // as a TCP session does
  bench.engine().request({.tick = 0, .axis = 0, .owner = 1000, .action = LeaseAction::kAcquire},
                         [&](Refused refused, Tick) { elsewhere = refused; });
  ASSERT_EQ(elsewhere, Refused::kNot);
  EXPECT_EQ(bench.acquire(3), 0);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kOwned));
}

// Catches: a second axis on an amplifier that can be leased or commanded, a reply that gives another reason,
// a tick that waits for it.
TEST(CanLease, OWN_01_AnAxisOnAnotherOnesAmplifierRefusesByACodeOfItsOwn) {
  BenchConfig config = on_bus(servo_bench(2), {});
  config.setup.axes[1].shares_amplifier_with = 0;
  CanBench bench(config);
  constexpr std::uint32_t kSecond = 2;
  constexpr auto kShared = static_cast<double>(Result::kSharedAmplifier);
  const auto result = [&bench] {
    const auto reply = bench.newest(Message::kReply, kSecond);
    return reply ? (*reply)["result"] : -1.0;
  };
  for (const std::uint8_t lease : {std::uint8_t{0}, bench.acquire()}) {
    for (const Request request :
         {Request::kAcquire, Request::kRenew, Request::kRelease, Request::kClearFaults}) {
      bench.request(request, lease, 77, kSecond);
      EXPECT_EQ(result(), kShared);
    }
    bench.command(0.0, 1.0, 0.0, lease, 1.0, kSecond);
    EXPECT_EQ(result(), kShared);
    if (lease == 0) continue;
    bench.command(0.0, 1.0, 0.0, lease);
    EXPECT_EQ(bench.engine().tick(), 1);
    EXPECT_TRUE(bench.newest(Message::kSensors, kSecond)) << "its samples go out as ever";
  }
}

// Catches: a controller that is refused, or one that asks without a lease, of which only a counter knows.
TEST(CanLease, SEC_07_ARefusedControllerStandsInTheAuditLog) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("drivebench-can-audit-" + std::to_string(::getpid()));
  std::filesystem::remove(file);
  {
    Audit audit(AuditConfig{.file = file, .on_failure = AuditFailure::kContinue});
    CanBench bench(on_bus(servo_bench(), {}), &audit);
    const std::uint8_t lease = bench.acquire(1);
    bench.acquire(2);
    bench.request(Request::kClearFaults, static_cast<std::uint8_t>(lease + 1), 2);
    bench.request(static_cast<Request>(9), lease, 3);
  }
  std::vector<std::array<std::string, 4>> said;
  std::ifstream in(file);
  for (std::string text; std::getline(in, text);) {
    const auto line = nlohmann::json::parse(text);
    said.push_back({line["event"], line["peer"], line["result"],
                    line["details"].value("request", 0) == 0 ? "" : line["details"]["request"].dump()});
  }
  std::filesystem::remove(file);
  const std::string owned(sentence_of(Refused::kOwned));
  const std::string not_owner(sentence_of(Refused::kNotOwner));
  EXPECT_EQ(said, (std::vector<std::array<std::string, 4>>{
                      {"acquire", "memory:bench controller 1", "done", ""},
                      {"acquire", "memory:bench controller 2", owned, ""},
                      {"forbidden", "memory:bench controller 2", not_owner, "4"},
                      {"forbidden", "memory:bench controller 3", "its code must be 1 to 4", "9"}}));
}

// Catches: a lease number 0, which means none, after 255 leases.
TEST(CanLease, LeaseNumbersSkipZeroWhenTheyWrap) {
  CanBench bench;
  for (int i = 0; i < 600; ++i) {
    const std::uint8_t lease = bench.acquire();
    ASSERT_EQ(lease, i % 255 + 1);
    bench.request(Request::kRelease, lease);
  }
}

// Catches: a latched fault that a stranger clears, or a command that gets through in spite of
// it.
TEST(CanLease, CMD_04_OnlyTheOwnerClearsALatchedFault) {
  BenchConfig config = servo_bench();
  config.setup.axes[0].parameters.drive.amplifier.over_current_a = 0.5;
  config.setup.axes[0].parameters.drive.amplifier.over_current_trip = true;
  config.can.emplace_back();
  CanBench bench(config);
  const std::uint8_t lease = bench.acquire();
  int tick = 0;
  while (bench.result() != static_cast<double>(Result::kLatched) && tick < 1000)
    bench.command(tick++, 60.0, 0.0, lease);
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kLatched));
  bench.request(Request::kClearFaults, static_cast<std::uint8_t>(lease + 1));
  EXPECT_EQ(bench.result(), static_cast<double>(Result::kNotOwner));
  bench.request(Request::kClearFaults, lease);
  EXPECT_EQ(bench.result(), 0.0);
  bench.command(static_cast<double>(bench.engine().tick()), 1.0, 0.0, lease);
  EXPECT_EQ(bench.result(), -1.0) << "no refusal";
}

// Catches: monitoring that begins before the first heartbeat, or never; a lost heartbeat without
// effect.
TEST(CanLease, CAN_12_AMissingHeartbeatEndsTheLeaseAndARestartEndsItAtOnce) {
  CanBench bench;
  std::uint8_t lease = bench.acquire();
  bench.command(0, 1.0, 0.0, lease);
  for (int beats = 0; beats < 12;
       ++beats) {  // 120 ms without a heartbeat of the controller: not monitored yet
    bench.received.clear();
    bench.wait_for(Message::kHeartbeat);
  }
  EXPECT_NE(bench.engine().owner(0), 0u);
  bench.send(Message::kControllerHeartbeat, std::array{5.0});
  while (bench.engine().owner(0) != 0) {
    bench.received.clear();
    bench.wait_for(Message::kHeartbeat);
  }
  EXPECT_EQ(bench.count("heartbeats_lost"), 1u);
  EXPECT_EQ((*bench.newest(Message::kHeartbeat))["lease"], 0.0);

  lease = bench.acquire();
  bench.send(Message::kControllerHeartbeat, std::array{0.0});  // its boot-up, late on the wire
  EXPECT_NE(bench.engine().owner(0), 0u);
  bench.send(Message::kControllerHeartbeat, std::array{5.0});
  bench.send(Message::kControllerHeartbeat, std::array{0.0});
  EXPECT_EQ(bench.engine().owner(0), 0u);
  lease = bench.acquire();
  bench.send(Message::kControllerHeartbeat, std::array{4.0});
  EXPECT_EQ(bench.engine().owner(0), 0u);
}

// Catches: a time-out that is looked at with each heartbeat of the bench only.
TEST(CanLease, ABenchWithoutHeartbeatsNoticesAMissingOne) {
  BenchConfig config = servo_bench();
  config.can.emplace_back();
  config.can.front().heartbeat_ms = 0;
  config.can.front().controller_timeout_ms = 10;
  CanBench bench(config);
  bench.acquire();
  bench.send(Message::kControllerHeartbeat, std::array{5.0});
  while (bench.engine().owner(0) != 0)
    bench.wait();
  EXPECT_EQ(bench.count("heartbeats_lost"), 1u);
  EXPECT_FALSE(bench.newest(Message::kHeartbeat));
}

// Catches: a controller that waits for the command of another axis and counts as silent; one that counts so
// at once when its tick has come, or never; one that is taken for the controller before it, which had
// commanded.
TEST(CanLease, AControllerThatWaitsForAnotherAxisIsNotSilent) {
  constexpr Owner kOther = 1000;
  constexpr auto kPatience = std::chrono::milliseconds(50);
  using Clock = std::chrono::steady_clock;
  BenchConfig config = servo_bench(2);
  config.can.emplace_back();
  config.can.front().idle_timeout_ms = kPatience.count();
  CanBench bench(config);
  bench.engine().request({.tick = 0, .axis = 1, .owner = kOther, .action = LeaseAction::kAcquire},
                         [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
  bench.command(0, 1.0, 0.0, bench.acquire());
  for (const auto end = Clock::now() + 3 * kPatience; Clock::now() < end;)
    bench.wait();
  ASSERT_EQ(bench.engine().tick(), 0);
  EXPECT_NE(bench.engine().owner(0), 0u);
  const auto began = Clock::now();
  bench.engine().command(1, kOther, voltage(0, 0.0, 0.0));
  bench.engine().advance();
  ASSERT_EQ(bench.engine().tick(), 1);
  while (bench.engine().owner(0) != 0)
    bench.wait();
  EXPECT_GE(Clock::now() - began, kPatience);

  const std::uint8_t lease = bench.acquire(1);
  bench.command(1, 1.0, 0.0, lease);
  bench.request(Request::kRelease, lease, 1);
  ASSERT_NE(bench.acquire(2), 0);
  while (bench.engine().owner(0) != 0)
    bench.wait();
  EXPECT_EQ(bench.engine().tick(), 1);
}

// Catches: an axis that stays taken for this bus after its controller lost it, while no tick shows the loss.
TEST(CanLease, AnAxisThatWasTakenAwayIsFreeAtOnce) {
  CanBench bench;
  const auto take_away = [&] {
    bench.engine().request(
        {.tick = 0, .axis = 0, .owner = bench.engine().owner(0), .action = LeaseAction::kLost},
        [](Refused refused, Tick) { EXPECT_EQ(refused, Refused::kNot); });
  };
  ASSERT_NE(bench.acquire(1), 0);
  take_away();
  EXPECT_NE(bench.acquire(2), 0);
  EXPECT_EQ(bench.result(), 0.0);
  take_away();
  bench.received.clear();
  EXPECT_EQ(bench.wait_for(Message::kHeartbeat)["lease"], 0.0);
  EXPECT_EQ(bench.engine().tick(), 0);
}

// Catches: a peer that fills the log by taking the axis and saying that it has stopped, again and again.
TEST(CanLease, LostControllersDoNotFillTheLog) {
  testing::internal::CaptureStderr();
  CanBench bench;
  for (int i = 0; i < 100; ++i) {
    EXPECT_NE(bench.acquire(), 0);
    bench.send(Message::kControllerHeartbeat, std::array{4.0});
  }
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  EXPECT_NE(text.find("axis 0 loses its controller"), std::string::npos) << text;
}

}  // namespace
}  // namespace drivebench::can::can_lease_test
