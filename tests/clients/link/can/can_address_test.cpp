#include "clients/link/can/can_address.hpp"

#include <gtest/gtest.h>

#include <string>

#include "clients/link/common/address.hpp"

namespace drivebench::link::can_address_test {
namespace {

// Catches: a back end, channel or default port that is taken apart at the wrong place.
TEST(CanAddress, ReadsEveryBackEnd) {
  const auto read = [](const char* text) { return to_string(parse_can_address(text)); };
  EXPECT_EQ(read("can:socketcan:vcan0"), "can:socketcan:vcan0");
  EXPECT_EQ(read("can:udp_multicast:239.1.2.3:5000"), "can:udp_multicast:239.1.2.3:5000");
  EXPECT_EQ(read("can:udp_multicast"), "can:udp_multicast:239.74.163.2:43113");
  EXPECT_EQ(read("can:slcan:tcp:127.0.0.1:29536?fd=0"), "can:slcan:tcp:127.0.0.1:29536");
  EXPECT_EQ(read("can:slcan:/dev/pts/3"), "can:slcan:/dev/pts/3");
  EXPECT_EQ(read("can:socketcand:127.0.0.1:29537?bus=can1"), "can:socketcand:127.0.0.1:29537");
  EXPECT_EQ(read("can:socketcand:localhost"), "can:socketcand:localhost:29536");
}

// Catches: a key that is read and not used, or used for another.
TEST(CanAddress, ReadsEveryKey) {
  const CanAddress a = parse_can_address(
      "can:socketcan:can0?node=17&fd=0&command=0x1234500&extended=1&current_unit_a=0.01&bus=x&bit_rate="
      "500000&data_bit_rate=2000000");
  EXPECT_EQ(a.node, 17U);
  EXPECT_FALSE(a.profile.fd);
  EXPECT_TRUE(a.profile.extended);
  EXPECT_EQ(a.profile.id_of(*can::find_message(can::Message::kCommand, false), a.node), 0x1234500U + 17);
  EXPECT_EQ(a.profile.current_unit_a, 0.01);
  EXPECT_EQ(a.profile.voltage_unit_v, can::Profile{}.voltage_unit_v);
  EXPECT_EQ(a.bus, "x");
  EXPECT_EQ(a.bit_rate, 500'000U);
  EXPECT_EQ(a.data_bit_rate, 2'000'000U);
  const auto ids = [](const char* text) { return parse_can_address(text).profile.base_ids; };
  EXPECT_EQ(ids("can:socketcan:can0"), can::default_ids(can::IdSet::kFree, false));
  EXPECT_EQ(ids("can:socketcan:can0?identifiers=free&extended=1"), can::default_ids(can::IdSet::kFree, true));
  EXPECT_EQ(ids("can:socketcan:can0?identifiers=canopen&node=127"),
            can::default_ids(can::IdSet::kCanopen, false));
  const CanAddress plain = parse_can_address("can:socketcan:can0");
  EXPECT_TRUE(plain.profile.fd);
  EXPECT_EQ(plain.node, 1U);
}

// Catches: an address that would speak on another bus, or with other frames, than was meant.
TEST(CanAddress, RefusesInvalidTexts) {
  for (const std::string text : {"can:",
                                 "can:vcan0",
                                 "can:socketcan",
                                 "can:socketcan:a_name_too_long_for_it",
                                 "can:udp_multicast:1.2.3.4",
                                 "can:udp_multicast:239.1.2.3:0",
                                 "can:udp_multicast:239.1.2.3:x",
                                 "can:slcan:",
                                 "can:slcan:ttyUSB0",
                                 "can:slcan:tcp:host:99999",
                                 "can:socketcand:",
                                 "can:socketcan:c?node=0",
                                 "can:socketcan:c?node=16",
                                 "can:socketcan:c?node=128&extended=1",
                                 "can:socketcan:c?node=128&identifiers=canopen",
                                 "can:socketcan:c?identifiers=cia301",
                                 "can:socketcan:c?node=x",
                                 "can:socketcan:c?fd=yes",
                                 "can:socketcan:c?speed=1",
                                 "can:socketcan:c?command=0x7F1",
                                 "can:socketcan:c?command=0x060",
                                 "can:socketcan:c?command=",
                                 "can:socketcan:c?current_unit_a=0",
                                 "can:socketcan:c?current_unit_a=1V",
                                 "can:slcan:/dev/x?bit_rate=123",
                                 "can:slcan:/dev/x?data_bit_rate=123"}) {
    EXPECT_THROW(parse_can_address(text), AddressError) << text;
  }
}

}  // namespace
}  // namespace drivebench::link::can_address_test
