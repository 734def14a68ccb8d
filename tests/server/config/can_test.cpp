#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/config/config.hpp"
#include "tests/server/config/config_test_bench.hpp"

namespace drivebench::test::can_test {
namespace {

/// kBench with one bus: [[can]] stands in line 21, `lines` from line 22 on.
std::string with_can(const std::string& lines) {
  return kBench + "[[can]]\n" + lines;
}

CanConfig bus_of(const std::string& lines) {
  return parse(with_can(lines)).can.at(0);
}

struct Case {
  std::string lines, said;
};

const std::string kUdp = "backend = \"udp_multicast\"\n";
const std::string kSocketCan = "backend = \"socketcan\"\nchannel = \"can0\"\n";
const std::string kSocketcand = "backend = \"socketcand\"\n";

// Catches: a rule of a bus that is not checked, or whose problem names the wrong line.
TEST(ConfigCan, EachRuleOfABusIsKept) {
  const std::vector<Case> cases = {
      {"", ":21: can.backend is missing"},
      {"backend = \"usb\"\n",
       ":22: can.backend is \"usb\" but must be one of \"socketcan\", \"udp_multicast\", "},
      {"backend = 1\n", ":22: can.backend is 1 but must be one of"},
      {"backend = \"usb\"\nport = 70000\n", ":23: can.port is 70000 but must lie between 0 and 65535"},
      {kUdp + "chanel = \"x\"\n", ":23: can.chanel is not a known key; did you mean \"channel\"?"},
      {kUdp + "channel = \"\"\n", ":23: can.channel is \"\" but must be text of 1 to 255 bytes"},
      {kUdp + "port = 0\n", ":23: can.port is 0 but must lie between 1 and 65535"},
      {kUdp + "port = 65536\n", ":23: can.port is 65536 but must lie between 1 and 65535"},
      {kSocketcand + "port = -1\n", ":23: can.port is -1 but must lie between 0 and 65535"},
      {kSocketCan + "port = 1\n", ":24: can.port is 1 but must be left out with backend \"socketcan\""},
      {"backend = \"slcan\"\nchannel = \"pty:/x\"\nport = 1\n",
       ":24: can.port is 1 but must be left out with backend \"slcan\""},
      {kUdp + "required = 1\n", ":23: can.required is 1 but must be true or false"},
      {kUdp + "fd = \"yes\"\n", ":23: can.fd is \"yes\" but must be true or false"},
      {kUdp + "extended = 29\n", ":23: can.extended is 29 but must be true or false"},
      {kUdp + "identifiers = \"CANopen\"\n",
       ":23: can.identifiers is \"CANopen\" but must be one of \"free\", \"canopen\""},
      {kUdp + "edges = 1\n", ":23: can.edges is 1 but must be true or false"},
      {kUdp + "fd = false\nedges = true\n", ":24: can.edges is true but must be false without fd = true"},
      {kUdp + "bit_rate = 9999\n", ":23: can.bit_rate is 9999 but must lie between 10000 and 1000000"},
      {kUdp + "bit_rate = 1000001\n", ":23: can.bit_rate is 1000001 but must lie between"},
      {kUdp + "bit_rate = 5e5\n", ":23: can.bit_rate is 5e+05 but must be a whole number"},
      {kUdp + "data_bit_rate = 9999\n",
       ":23: can.data_bit_rate is 9999 but must lie between 10000 and 8000000"},
      {kUdp + "data_bit_rate = 8000001\n", ":23: can.data_bit_rate is 8000001 but must lie between"},
      {kUdp + "data_bit_rate = 999999\n",
       ":23: can.data_bit_rate is 999999 but must not be lower than bit_rate = 1000000"},
      {kUdp + "sample_every_ticks = 0\n",
       ":23: can.sample_every_ticks is 0 but must lie between 1 and 1000000"},
      {kUdp + "state_every_ticks = 1000001\n",
       ":23: can.state_every_ticks is 1000001 but must lie between 1 and"},
      {kUdp + "heartbeat_ms = 9\n", ":23: can.heartbeat_ms is 9 but must be 0 or at least 10"},
      {kUdp + "heartbeat_ms = 60001\n", ":23: can.heartbeat_ms is 60001 but must lie between 0 and 60000"},
      {kUdp + "controller_timeout_ms = 9\n",
       ":23: can.controller_timeout_ms is 9 but must lie between 10 and 60000"},
      {kUdp + "idle_timeout_ms = 99\n", ":23: can.idle_timeout_ms is 99 but must be 0 or at least 100"},
      {kUdp + "idle_timeout_ms = 86400001\n",
       ":23: can.idle_timeout_ms is 86400001 but must lie between 0 and"},
      {kUdp + "ids = 1\n", ":23: can.ids is 1 but must be a table: [can.ids]"},
      {kUdp + "units = 1\n", ":23: can.units is 1 but must be a table: [can.units]"},
      {kUdp + "[can.filters]\n", ":23: can.filters is not a known key; known here: backend, channel, port, "},
  };
  for (const Case& c : cases) {
    const std::string found = problems_of(with_can(c.lines));
    EXPECT_NE(found.find("b.toml" + c.said), std::string::npos) << c.lines << "  gave: " << found;
  }
  EXPECT_NE(
      problems_of(kBench + "[can]\nbackend = \"slcan\"\n").find(":21: can is a table but must be a list of"),
      std::string::npos);
}

// Catches: a channel that its back end cannot open, or that lets other computers command the bench.
TEST(ConfigCan, ChannelsFitTheirBackEnd) {
  const auto quoted = [](const std::string& backend, const std::string& channel) {
    return "backend = \"" + backend + "\"\nchannel = \"" + channel + "\"\n";
  };
  const std::vector<std::pair<std::string, std::string>> good = {
      {"socketcan", "can0"},
      {"socketcan", "fifteen-bytes.x"},
      {"udp_multicast", "224.0.0.1"},
      {"udp_multicast", "239.255.255.255"},
      {"udp_multicast", "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173"},
      {"slcan", "pty:/run/bench/can"},
      {"slcan", "tcp:127.0.0.1:0"},
      {"slcan", "tcp:localhost:65535"},
      {"slcan", "tcp:[::1]:3333"},
      {"slcan", "/dev/ttyACM0"},
      {"slcan", "/dev/serial/by-id/usb-x@y@115200"},
      {"slcan", "/dev/ttyUSB0@4000000"},
      {"socketcand", "127.0.0.2"},
      {"socketcand", "localhost"},
      {"socketcand", "::1"},
  };
  for (const auto& [backend, channel] : good)
    EXPECT_EQ(problems_of(with_can(quoted(backend, channel))), "none");
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"socketcan", "sixteen-bytes-xy"},
      {"socketcan", "a/b"},
      {"socketcan", "can0:1"},
      {"socketcan", "can 0"},
      {"socketcan", "."},
      {"socketcan", ".."},
      {"udp_multicast", "127.0.0.1"},
      {"udp_multicast", "223.255.255.255"},
      {"udp_multicast", "240.0.0.1"},
      {"udp_multicast", "fe80::1"},
      {"udp_multicast", "localhost"},
      {"udp_multicast", "239.1"},
      {"slcan", "pty:"},
      {"slcan", "pty:can"},
      {"slcan", "pty:/run/"},
      {"slcan", "tcp:127.0.0.1"},
      {"slcan", "tcp:127.0.0.1:"},
      {"slcan", "tcp:127.0.0.1:65536"},
      {"slcan", "tcp:127.0.0.1:-0"},
      {"slcan", "tcp:127.0.0.1:1x"},
      {"slcan", "tcp::1"},
      {"slcan", "tcp:0.0.0.0:3333"},
      {"slcan", "tcp:[::]:3333"},
      {"slcan", "tcp:192.0.2.1:3333"},
      {"slcan", "ttyUSB0"},
      {"slcan", "/"},
      {"slcan", "/dev/ttyUSB0@"},
      {"slcan", "/dev/ttyUSB0@299"},
      {"slcan", "/dev/ttyUSB0@4000001"},
      {"slcan", "/dev/ttyUSB0@fast"},
      {"socketcand", "0.0.0.0"},
      {"socketcand", "::"},
      {"socketcand", "192.0.2.1"},
      {"socketcand", "bench"},
  };
  for (const auto& [backend, channel] : bad) {
    const std::string found = problems_of(with_can(quoted(backend, channel)));
    EXPECT_EQ(found.find("b.toml:23: can.channel is \"" + channel + "\" but must be "), 0u)
        << backend << ' ' << channel << "\n  gave: " << found;
  }
  for (const std::string backend : {"socketcan", "slcan"}) {
    EXPECT_NE(problems_of(with_can("backend = \"" + backend + "\"\n")).find(":21: can.channel is missing"),
              std::string::npos);
  }
}

// Catches: a default that is not the documented one, and the port of one back end with another.
TEST(ConfigCan, DefaultsDependOnTheBackEnd) {
  const CanConfig udp = bus_of(kUdp);
  EXPECT_EQ(udp.backend, can::Backend::kUdpMulticast);
  expect_equal(udp, CanConfig{});
  const CanConfig socketcand = bus_of(kSocketcand);
  EXPECT_EQ(socketcand.channel, "127.0.0.1");
  EXPECT_EQ(socketcand.port, 29536);
  EXPECT_EQ(bus_of(kSocketcand + "port = 0\n").port, 0);
  EXPECT_EQ(parse(kBench).can.size(), 0u);
}

// Catches: identifiers outside 11 or 29 bits once the node id is added, and two messages with the same one.
TEST(ConfigCan, EachRuleOfTheIdentifiersIsKept) {
  const std::string ids = kUdp + "[can.ids]\n";
  const std::vector<Case> cases = {
      {ids + "state = 2033\n", ":24: can.ids.state is 2033 but must lie between 0 and 2032"},
      {ids + "state = 0x7f1\n", ":24: can.ids.state is 0x7f1 but must lie between 0x0 and 0x7f0"},
      {ids + "sync = 0x800\n", ":24: can.ids.sync is 0x800 but must lie between 0x0 and 0x7ff"},
      {ids + "state = -1\n", ":24: can.ids.state is -1 but must lie between 0 and 2032"},
      {ids + "state = 0b1\n",
       ":24: can.ids.state is a number that is not decimal but must be a whole number"},
      {ids + "state = \"0x1\"\n", ":24: can.ids.state is \"0x1\" but must be a whole number"},
      {ids + "state = 0x040\nencoder = 0x690\nreply = 0x040\n",
       ":24: can.ids.state is 0x40 but must keep its identifiers apart from those of ids.reply"},
      {ids + "sync = 0x7ff\nstate = 0x030\n",
       ":25: can.ids.state is 0x30 but must keep its identifiers apart"},
      {ids + "state = 0x06f\n", ":24: can.ids.state is 0x6f but must keep its identifiers apart"},
      {ids + "sync = 0x061\n",
       "can.ids.sensors is 0x60 but must keep its identifiers apart from those of ids.sync"},
      {ids + "stat = 1\n", ":24: can.ids.stat is not a known key; did you mean \"state\"?"},
      {kUdp + "identifiers = \"canopen\"\n[can.ids]\nstate = 0x781\n",
       ":25: can.ids.state is 0x781 but must lie between 0x0 and 0x780"},
      {kUdp + "extended = true\n[can.ids]\nstate = 0x1fffff81\n",
       ":25: can.ids.state is 0x1fffff81 but must lie between 0x0 and 0x1fffff80"},
  };
  for (const Case& c : cases) {
    const std::string found = problems_of(with_can(c.lines));
    EXPECT_NE(found.find("b.toml" + (c.said[0] == ':' ? c.said : ":23: " + c.said)), std::string::npos)
        << c.lines << "  gave: " << found;
  }
  // Messages of the other variant take no room.
  EXPECT_EQ(problems_of(with_can(ids + "encoder = 0x6c0\n")), "none");
  EXPECT_NE(problems_of(with_can(kUdp + "fd = false\n[can.ids]\nstate = 0x040\n")), "none");
  EXPECT_EQ(problems_of(with_can(kUdp + "fd = false\n[can.ids]\nedges = 0x040\n")), "none");
}

// Catches: a message without a key, and a key that changes another message.
TEST(ConfigCan, EveryMessageHasAKey) {
  for (const can::MessageRow& row : can::kMessages) {
    const std::string name(row.name);
    const CanConfig bus = bus_of(kUdp + "extended = true\n[can.ids]\n" + name + " = 0x12345\n");
    can::Profile expected;
    expected.choose_ids(can::IdSet::kFree, true);
    expected.base_ids[static_cast<std::size_t>(row.message)] = 0x12345;
    EXPECT_EQ(bus.profile.base_ids, expected.base_ids) << name;
  }
}

// Catches: a hexadecimal identifier that reads as another number, and such a number outside of [can.ids].
TEST(ConfigCan, OnlyIdentifiersMayBeHexadecimal) {
  const auto state_id = [](const std::string& number) {
    const can::Profile profile = bus_of(kUdp + "[can.ids]\nstate = " + number + "\n").profile;
    return profile.base_ids[static_cast<std::size_t>(can::Message::kState)];
  };
  EXPECT_EQ(state_id("0x600"), 0x600u);
  EXPECT_EQ(state_id("1536"), 0x600u);
  EXPECT_NE(
      problems_of(with_can(kUdp + "port = 0x600\n")).find(":23: can.port is a number that is not decimal"),
      std::string::npos);
}

// Catches: a unit that makes every value zero or infinite, and one that lands in another field.
TEST(ConfigCan, UnitsArePositiveAndFinite) {
  const std::string units = kUdp + "[can.units]\n";
  for (const std::string key : {"current_a", "voltage_v", "bus_voltage_v", "speed_rad_s", "edge_time_s"}) {
    for (const std::string value : {"0", "-1.0", "9e-13", "1.1e6"}) {
      const std::string found = problems_of(with_can(units + key + " = " + value + "\n"));
      EXPECT_EQ(found.find("b.toml:24: can.units." + key + " is "), 0u) << found;
      EXPECT_NE(found.find("must lie between 1e-12 and 1e+06"), std::string::npos) << found;
    }
    EXPECT_NE(problems_of(with_can(units + key + " = nan\n")).find("must be a finite number"),
              std::string::npos);
  }
  EXPECT_NE(
      problems_of(with_can(units + "speed_rpm = 1\n")).find(":24: can.units.speed_rpm is not a known key"),
      std::string::npos);
  const can::Profile p = bus_of(units +
                                "current_a = 1\nvoltage_v = 2\nbus_voltage_v = 3\nspeed_rad_s = 4\n"
                                "edge_time_s = 5\n")
                             .profile;
  EXPECT_EQ(p.current_unit_a, 1.0);
  EXPECT_EQ(p.voltage_unit_v, 2.0);
  EXPECT_EQ(p.bus_voltage_unit_v, 3.0);
  EXPECT_EQ(p.speed_unit_rad_s, 4.0);
  EXPECT_EQ(p.edge_time_unit_s, 5.0);
}

// Catches: two sections that open the same bus twice, so that the bench hears itself.
TEST(ConfigCan, NoTwoSectionsShareABus) {
  const std::string head = "[[can]]\n";
  const auto both = [&](const std::string& x, const std::string& y) {
    return problems_of(with_can(x + head + y));
  };
  const auto slcan = [](const std::string& channel) {
    return "backend = \"slcan\"\nchannel = \"" + channel + "\"\n";
  };
  EXPECT_EQ(both(kSocketCan, kSocketCan),
            "b.toml:26: can.channel is \"can0\", the channel of another socketcan bus");
  EXPECT_EQ(both(kUdp, kUdp + "channel = \"239.1.2.3\"\n"),
            "b.toml:23: can.port is 43113, the port of another udp_multicast bus: all groups at a port are "
            "one bus");
  EXPECT_NE(both(slcan("/dev/ttyUSB0"), slcan("/dev/ttyUSB0@115200")), "none");
  EXPECT_NE(both(slcan("pty:/x"), slcan("pty:/x")), "none");
  EXPECT_NE(both(slcan("tcp:127.0.0.1:5"), slcan("tcp:127.0.0.1:5")), "none");
  EXPECT_NE(both(kSocketcand, kSocketcand), "none");

  EXPECT_EQ(both(kUdp, kUdp + "port = 43114\n"), "none");
  EXPECT_EQ(both(slcan("tcp:127.0.0.1:0"), slcan("tcp:127.0.0.1:0")), "none");
  EXPECT_EQ(both(kSocketcand + "port = 0\n", kSocketcand + "port = 0\n"), "none");
  EXPECT_EQ(both(kSocketcand, kSocketcand + "channel = \"127.0.0.2\"\n"), "none");
  EXPECT_EQ(both(kSocketCan, slcan("pty:/can0")), "none");
}

// Catches: tables that go to the first bus or to all, a ninth bus, and other nodes than the numbers of the
// axes.
TEST(ConfigCan, TablesBelongToTheBusAboveThem) {
  const std::string text = with_can(kSocketCan +
                                    "[can.ids]\nstate = 0x600\n[can.units]\ncurrent_a = 0.5\n"
                                    "[[can]]\n" +
                                    kUdp + "[can.units]\ncurrent_a = 0.25\n");
  const BenchConfig config = parse(text);
  ASSERT_EQ(config.can.size(), 2u);
  const auto state = static_cast<std::size_t>(can::Message::kState);
  EXPECT_EQ(config.can[0].profile.base_ids[state], 0x600u);
  EXPECT_EQ(config.can[1].profile.base_ids[state], 0x690u);
  EXPECT_EQ(config.can[0].profile.current_unit_a, 0.5);
  EXPECT_EQ(config.can[1].profile.current_unit_a, 0.25);

  std::string buses;
  for (int i = 0; i < 8; ++i)
    buses += "[[can]]\n" + kUdp + "port = " + std::to_string(1000 + i) + "\n";
  EXPECT_EQ(parse(kBench + buses).can.size(), 8u);
  EXPECT_NE(
      problems_of(kBench + buses + "[[can]]\n" + kUdp).find("can occurs 9 times but may occur at most 8"),
      std::string::npos);

  const std::string axis = kBench.substr(kBench.find("[axis.machine]"));
  const BenchConfig axes =
      parse(kBench + "[[axis]]\nname = \"y\"\ncan_node = 9\n" + axis + "[[axis]]\nname = \"z\"\n" + axis);
  EXPECT_EQ(axes.axes[0].can_node, 1u);
  EXPECT_EQ(axes.axes[1].can_node, 9u);
  EXPECT_EQ(axes.axes[2].can_node, 3u);
}

// Catches: a set of identifiers that is read and not used, or taken for the other; a node that its
// identifiers have no room for, noticed on the bus only.
TEST(ConfigCan, TheSetOfIdentifiersIsChosen) {
  const auto ids = [](const std::string& lines) { return bus_of(kUdp + lines).profile.base_ids; };
  EXPECT_EQ(ids(""), can::default_ids(can::IdSet::kFree, false));
  EXPECT_EQ(ids("identifiers = \"free\"\n"), can::default_ids(can::IdSet::kFree, false));
  EXPECT_EQ(ids("extended = true\n"), can::default_ids(can::IdSet::kFree, true));
  EXPECT_EQ(ids("identifiers = \"canopen\"\n"), can::default_ids(can::IdSet::kCanopen, false));
  EXPECT_EQ(ids("extended = true\nidentifiers = \"canopen\"\n"),
            can::default_ids(can::IdSet::kCanopen, true));
  EXPECT_EQ(bus_of(kUdp + "identifiers = \"canopen\"\n").profile.id_set, can::IdSet::kCanopen);

  const auto with_node = [](const std::string& node, const std::string& lines) {
    std::string text = with_can(lines);
    const std::string name = "[[axis]]\n";
    return problems_of(text.insert(text.find(name) + name.size(), "can_node = " + node + "\n"));
  };
  EXPECT_EQ(with_node("15", kUdp), "none");
  EXPECT_NE(with_node("16", kUdp).find("can.identifiers is \"free\", which has room for nodes 1 to 15"),
            std::string::npos)
      << with_node("16", kUdp);
  EXPECT_EQ(with_node("127", kUdp + "extended = true\n"), "none");
  EXPECT_EQ(with_node("127", kUdp + "identifiers = \"canopen\"\n"), "none");
}

// Catches: a list of words that is not in the order of the enumeration.
TEST(ConfigCan, BackEndsAreNamedAsInTheFile) {
  EXPECT_EQ(can::name_of(can::Backend::kSocketCan), "socketcan");
  EXPECT_EQ(can::name_of(can::Backend::kUdpMulticast), "udp_multicast");
  EXPECT_EQ(can::name_of(can::Backend::kSlcan), "slcan");
  EXPECT_EQ(can::name_of(can::Backend::kSocketcand), "socketcand");
  EXPECT_EQ(bus_of(kSocketCan).backend, can::Backend::kSocketCan);
  EXPECT_EQ(bus_of(kSocketcand).backend, can::Backend::kSocketcand);
}

}  // namespace
}  // namespace drivebench::test::can_test
