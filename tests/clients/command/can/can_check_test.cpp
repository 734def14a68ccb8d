// `drivebench can check` on controllers that no test machine has: what a driver would have told the kernel.
#include "clients/command/can/can_check.hpp"

#include <gtest/gtest.h>
#include <linux/can/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>

#include <cstring>
#include <random>

namespace drivebench::command::can_check_test {
namespace {

using Bytes = std::vector<std::byte>;

template <class T>
Bytes bytes_of(const T& value) {
  Bytes bytes(sizeof value);
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

Bytes text(std::string_view word) {
  Bytes bytes(word.size() + 1);
  std::memcpy(bytes.data(), word.data(), word.size());
  return bytes;
}

Bytes attribute(int type, const Bytes& content) {
  const nlattr head = {.nla_len = static_cast<std::uint16_t>(sizeof(nlattr) + content.size()),
                       .nla_type = static_cast<std::uint16_t>(type)};
  Bytes bytes = bytes_of(head);
  bytes.insert(bytes.end(), content.begin(), content.end());
  bytes.resize((bytes.size() + 3) / 4 * 4);
  return bytes;
}

Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes all;
  for (const Bytes& part : parts)
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// A controller at 1 and 5 Mbit/s, as a driver shows it.
struct Hardware {
  std::uint32_t state = CAN_STATE_ERROR_ACTIVE;
  std::uint32_t restart_ms = 100;
  std::uint32_t queue = 1000;
  std::uint32_t mtu = 72;
  std::uint32_t mode = CAN_CTRLMODE_FD;
  std::uint32_t sjw = 8;
  unsigned flags = IFF_UP | IFF_RUNNING;

  Bytes message() const {
    const can_bittiming slow = {.bitrate = 1'000'000,
                                .sample_point = 800,
                                .tq = 12,
                                .prop_seg = 31,
                                .phase_seg1 = 32,
                                .phase_seg2 = 16,
                                .sjw = sjw,
                                .brp = 1};
    const can_bittiming fast = {.bitrate = 5'000'000,
                                .sample_point = 750,
                                .tq = 12,
                                .prop_seg = 5,
                                .phase_seg1 = 6,
                                .phase_seg2 = 4,
                                .sjw = std::min(sjw, 2u),
                                .brp = 1};
    const Bytes data = joined({attribute(IFLA_CAN_BITTIMING, bytes_of(slow)),
                               attribute(IFLA_CAN_DATA_BITTIMING, bytes_of(fast)),
                               attribute(IFLA_CAN_STATE, bytes_of(state)),
                               attribute(IFLA_CAN_CTRLMODE, bytes_of(can_ctrlmode{.mask = 0, .flags = mode})),
                               attribute(IFLA_CAN_RESTART_MS, bytes_of(restart_ms))});
    const Bytes info = joined({attribute(IFLA_INFO_KIND, text("can")), attribute(IFLA_INFO_DATA, data)});
    ifinfomsg body{};
    body.ifi_type = ARPHRD_CAN;
    body.ifi_flags = flags;
    Bytes rest =
        joined({bytes_of(body), attribute(IFLA_IFNAME, text("can0")), attribute(IFLA_MTU, bytes_of(mtu)),
                attribute(IFLA_TXQLEN, bytes_of(queue)), attribute(IFLA_LINKINFO | NLA_F_NESTED, info)});
    nlmsghdr head{};
    head.nlmsg_type = RTM_NEWLINK;
    head.nlmsg_len = static_cast<std::uint32_t>(sizeof head + rest.size());
    return joined({bytes_of(head), rest});
  }
};

std::vector<CanFinding> problems_of(const Hardware& hardware) {
  std::vector<CanFinding> found = can_findings(parse_link_message(hardware.message()).value(), false);
  std::erase_if(found, [](const CanFinding& finding) { return !finding.problem; });
  return found;
}

/// The cure of the one problem that there is.
std::string cure_of(const Hardware& hardware) {
  const std::vector<CanFinding> found = problems_of(hardware);
  return found.size() == 1 ? found[0].cure : std::to_string(found.size()) + " problems";
}

// Catches: a field of the kernel's answer read from the wrong place or in the wrong unit.
TEST(CanCheck, ReadsTheAnswerOfTheDriver) {
  const CanInterface interface = parse_link_message(Hardware{}.message()).value();
  EXPECT_EQ(interface.name, "can0");
  EXPECT_TRUE(interface.is_can && interface.up);
  EXPECT_EQ(interface.kind, "can");
  EXPECT_EQ(interface.mtu, 72u);
  EXPECT_EQ(interface.queue_length, 1000u);
  const CanController& controller = interface.controller.value();
  EXPECT_EQ(controller.state, CanControllerState::kErrorActive);
  EXPECT_TRUE(controller.fd);
  EXPECT_EQ(controller.restart_ms, 100u);
  EXPECT_EQ(controller.timing.value().bit_rate, 1'000'000u);
  EXPECT_DOUBLE_EQ(controller.timing.value().sample_point, 0.8);
  EXPECT_EQ(controller.timing.value().quanta, 80u);
  EXPECT_EQ(controller.data_timing.value().bit_rate, 5'000'000u);
}

// Catches: a problem that is not found, found where there is none, or cured by lines that are not ip's.
TEST(CanCheck, EachProblemHasItsCure) {
  EXPECT_TRUE(problems_of({}).empty());
  EXPECT_EQ(cure_of({.queue = 10}), "ip link set can0 txqueuelen 1000");
  EXPECT_EQ(cure_of({.restart_ms = 0}),
            "ip link set can0 down; ip link set can0 type can restart-ms 100; ip link set can0 up");
  EXPECT_EQ(cure_of({.state = CAN_STATE_STOPPED, .flags = 0}), "ip link set can0 up");
  EXPECT_TRUE(cure_of({.state = CAN_STATE_BUS_OFF}).starts_with("ip link set can0 type can restart;"));
  EXPECT_NE(cure_of({.state = CAN_STATE_ERROR_PASSIVE}).find("60 ohm"), std::string::npos);
  EXPECT_NE(cure_of({.state = CAN_STATE_ERROR_WARNING}).find("60 ohm"), std::string::npos);
  EXPECT_NE(cure_of({.mtu = 16, .mode = 0}).find("dbitrate 5000000"), std::string::npos);
  EXPECT_NE(cure_of({.mode = CAN_CTRLMODE_FD | CAN_CTRLMODE_LISTENONLY}).find("listen-only off"),
            std::string::npos);
  EXPECT_NE(cure_of({.mode = CAN_CTRLMODE_FD | CAN_CTRLMODE_ONE_SHOT}).find("one-shot off"),
            std::string::npos);
  EXPECT_EQ(
      cure_of({.sjw = 1}),
      "ip link set can0 down; ip link set can0 type can bitrate 1000000 sample-point 0.800 sjw 8 dbitrate "
      "5000000 dsample-point 0.750 dsjw 2 fd on; ip link set can0 up");
}

// Catches: classic CAN called a problem where it was asked for.
TEST(CanCheck, ClassicCanIsNoProblemIfRequested) {
  const Hardware hardware{.mtu = 16, .mode = 0};
  const std::vector<CanFinding> found = can_findings(parse_link_message(hardware.message()).value(), true);
  EXPECT_TRUE(std::none_of(found.begin(), found.end(), [](const auto& each) { return each.problem; }));
}

// Catches: reading past a message that is cut short or lies about its lengths.
TEST(CanCheck, DamagedAnswersDoNoHarm) {
  const Bytes whole = Hardware{}.message();
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(parse_link_message(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))));
  std::mt19937 random(3);
  for (int round = 0; round < 20'000; ++round) {
    Bytes damaged = whole;
    for (int i = 0; i < 3; ++i)
      damaged[random() % damaged.size()] = static_cast<std::byte>(random());
    if (const auto interface = parse_link_message(damaged)) can_findings(*interface, false);
  }
}

// Catches: an interface that is not there taken for one without problems.
TEST(CanCheck, AMissingInterfaceIsAnError) {
  EXPECT_FALSE(read_can_interface("nosuchcan0"));
  EXPECT_FALSE(read_can_interface(""));
  EXPECT_FALSE(read_can_interface("a_name_that_is_far_too_long"));
  EXPECT_FALSE(read_can_interface("lo").value().is_can);
  EXPECT_EQ(run_can_check({.interface = "lo"}), 2);
  EXPECT_EQ(run_can_check({.interface = "nosuchcan0", .json = true}), 2);
}

}  // namespace
}  // namespace drivebench::command::can_check_test
