#include "protocols/can/codec.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>

#include "tests/protocols/can/can_edge.hpp"
#include "tests/protocols/can/can_sample.hpp"

namespace drivebench::can::can_codec_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMax = std::numeric_limits<double>::max();
constexpr double kDenormal = std::numeric_limits<double>::denorm_min();

/// A frame of the message with one value in one field and 0 in the others.
Frame frame_with(Message message, bool fd, std::string_view field, double value) {
  const MessageRow& row = *find_message(message, fd);
  Values values{};
  values[index_of(message, fd, field)] = value;
  return encode(row, profile_of(fd), 1, values);
}

std::uint64_t raw_in(const Frame& frame, Message message, bool fd, std::string_view name) {
  const Field& field = find_message(message, fd)->fields[index_of(message, fd, name)];
  std::uint64_t raw = 0;
  for (unsigned bit = 0; bit < field.bits; bit += 8)
    raw |= std::uint64_t{frame.data[(field.start_bit + bit) / 8U]} << bit;
  return raw;
}

std::uint64_t raw_of(Message message, bool fd, std::string_view name, double value) {
  return raw_in(frame_with(message, fd, name, value), message, fd, name);
}

double back_from(Message message, bool fd, std::string_view name, double value) {
  const Frame frame = frame_with(message, fd, name, value);
  return decode(*find_message(message, fd), profile_of(fd), frame)[index_of(message, fd, name)];
}

// Catches: a byte order, a place or a scale that changes: the bytes on the wire are a promise.
TEST(CanCodec, ClassicFramesHaveTheseBytes) {
  EXPECT_EQ(data_of(sent(Message::kSync, false)), "8967452300");
  EXPECT_EQ(data_of(sent(Message::kFault, false)), "1000008089674523");
  EXPECT_EQ(data_of(sent(Message::kCurrents, false)), "E80330F889672301");
  EXPECT_EQ(data_of(sent(Message::kEncoder, false)), "FEFFFFFFE803D007");
  EXPECT_EQ(data_of(sent(Message::kState, false)), "18FCE00110000080");
  EXPECT_EQ(data_of(sent(Message::kCounters, false)), "8867020003000402");
  EXPECT_EQ(data_of(sent(Message::kIndex, false)), "00FFFFFFFFFFFFFF");
  const Values command = {12.34, -0.01, 0x12345, 1, 0, 200};
  EXPECT_EQ(data_of(encode(*find_message(Message::kCommand, false), profile_of(false), 1, command)),
            "D204FFFF452301C8");
  const Values reply = {1, 2, 0xDEADBEEF, 7, 0x145};
  EXPECT_EQ(data_of(encode(*find_message(Message::kReply, false), profile_of(false), 1, reply)),
            "0102EFBEADDE0745");
}

// Catches: the same in FD frames, and one that is shorter than its size or leaves bytes of no field unset.
TEST(CanCodec, FdFramesHaveTheseBytes) {
  EXPECT_EQ(data_of(sent(Message::kSensors, true)),
            "89674523"
            "0000803F"
            "000000C0"
            "FEFFFFFF"
            "6F12833A"
            "6F12033B"
            "88674523"
            "23020200");
  EXPECT_EQ(data_of(sent(Message::kState, true)),
            "89674523"
            "0000C8C2"
            "00004042"
            "10000080"
            "03000401");
  const Values command = {0x12345, 1.5, -0.25, 3, 0, 9};
  EXPECT_EQ(data_of(encode(*find_message(Message::kCommand, true), profile_of(true), 1, command)),
            "45230100"
            "0000C03F"
            "000080BE"
            "03090000");
  EXPECT_EQ(data_of(sent(Message::kEdges, true)), std::string(128, '0'));
}

// Catches: a wrong identifier, or a frame of the wrong kind for the profile.
TEST(CanCodec, AFrameCarriesItsIdentifierAndKind) {
  Profile profile = profile_of(true);
  const MessageRow& row = *find_message(Message::kSensors, true);
  Frame frame = encode_sample(row, profile, 5, a_sample());
  EXPECT_EQ(frame.id, 0x065u);
  EXPECT_EQ(frame.size, 32);
  EXPECT_TRUE(frame.fd && frame.bit_rate_switch && !frame.extended && !frame.remote && !frame.error);

  profile.extended = true;
  profile.base_ids[static_cast<std::size_t>(Message::kSensors)] = 0x1ABCDE00;
  frame = encode_sample(row, profile, 127, a_sample());
  EXPECT_EQ(frame.id, 0x1ABCDE7Fu);
  EXPECT_TRUE(frame.extended);

  EXPECT_EQ(sent(Message::kSync, false).id, 0x008u) << "has no node";
  EXPECT_FALSE(sent(Message::kSync, false).fd || sent(Message::kSync, false).bit_rate_switch);
}

// Catches: a counter that saturates, loses its sign or is undefined for what no integer holds.
TEST(CanCodec, ACounterWraps) {
  const auto raw = [](double value) { return raw_of(Message::kCounters, false, "missed", value); };
  EXPECT_EQ(raw(65535.0), 65535u);
  EXPECT_EQ(raw(65536.0), 0u);
  EXPECT_EQ(raw(-1.0), 65535u);
  EXPECT_EQ(raw(-0.0), 0u);
  EXPECT_EQ(raw(kDenormal), 0u);
  EXPECT_EQ(raw(0x1p53 - 1.0), 65535u);
  EXPECT_EQ(raw(0x1p63), 0u);
  EXPECT_EQ(raw(-0x1p63), 0u);
  EXPECT_EQ(raw(kMax), 0u);
  EXPECT_EQ(raw(-kMax), 0u);
  EXPECT_EQ(raw(kNan), 0u);
  EXPECT_EQ(raw(kInfinity), 0u);
  EXPECT_EQ(raw(-kInfinity), 0u);
  EXPECT_EQ(raw_of(Message::kSync, false, "tick", 0x1p32 - 1.0), 0xFFFF'FFFFu);
  EXPECT_EQ(raw_of(Message::kSync, false, "tick", -1.0), 0xFFFF'FFFFu) << "none yet";
}

// Catches: a count that stops at the end of 32 bits.
TEST(CanCodec, ACountWrapsBothWays) {
  const auto back = [](double value) { return back_from(Message::kEncoder, false, "encoder_count", value); };
  EXPECT_EQ(back(-1.0), -1.0);
  EXPECT_EQ(back(0x1p31 - 1.0), 0x1p31 - 1.0);
  EXPECT_EQ(back(0x1p31), -0x1p31);
  EXPECT_EQ(back(-0x1p31 - 1.0), 0x1p31 - 1.0);
  EXPECT_EQ(back(0x1p40 + 7.0), 7.0);
  EXPECT_EQ(back(kNan), 0.0);
}

// Catches: a code that wraps into another meaning.
TEST(CanCodec, ACodeSaturates) {
  const auto raw = [](double value) { return raw_of(Message::kCurrents, false, "command_age", value); };
  EXPECT_EQ(raw(255.0), 255u);
  EXPECT_EQ(raw(256.0), 255u);
  EXPECT_EQ(raw(kMax), 255u);
  EXPECT_EQ(raw(kInfinity), 255u);
  EXPECT_EQ(raw(-1.0), 0u);
  EXPECT_EQ(raw(-kInfinity), 0u);
  EXPECT_EQ(raw(kNan), 0u);
  EXPECT_EQ(raw_of(Message::kFault, false, "faults", 0x1p32), 0xFFFF'FFFFu);
}

// Catches: a current that changes its sign beyond the range, the pattern of "no value" sent for a number, and
// rounding towards 0.
TEST(CanCodec, AScaledNumberRoundsSaturatesAndHasACodeForNoValue) {
  const auto raw = [](double value) { return raw_of(Message::kCurrents, false, "i_a", value); };
  EXPECT_EQ(raw(0.0014), 1u);
  EXPECT_EQ(raw(0.0016), 2u);
  EXPECT_EQ(raw(-0.0016), 0xFFFEu);
  EXPECT_EQ(raw(32.7674), 0x7FFFu);
  EXPECT_EQ(raw(32.768), 0x7FFFu);
  EXPECT_EQ(raw(-32.768), 0x8001u) << "the lowest number means no value";
  EXPECT_EQ(raw(kMax), 0x7FFFu);
  EXPECT_EQ(raw(-kMax), 0x8001u);
  EXPECT_EQ(raw(kInfinity), 0x7FFFu);
  EXPECT_EQ(raw(-kInfinity), 0x8001u);
  EXPECT_EQ(raw(kNan), 0x8000u);
  EXPECT_EQ(raw(-kNan), 0x8000u);
  EXPECT_EQ(raw(-0.0), 0u);
  EXPECT_EQ(raw(-kDenormal), 0u);
  EXPECT_DOUBLE_EQ(back_from(Message::kCurrents, false, "i_a", -1.25), -1.25);
  EXPECT_TRUE(std::isnan(back_from(Message::kCurrents, false, "i_a", kNan)));
}

// Catches: a long age that wraps into a short one or reads as "no value".
TEST(CanCodec, AnUnsignedScaledNumberStopsOneBelowNoValue) {
  const auto raw = [](double value) { return raw_of(Message::kEncoder, false, "edge_age", value); };
  EXPECT_EQ(raw(1.6e-6), 2u);
  EXPECT_EQ(raw(0.065534), 0xFFFEu);
  EXPECT_EQ(raw(0.065535), 0xFFFEu);
  EXPECT_EQ(raw(3600.0), 0xFFFEu);
  EXPECT_EQ(raw(kInfinity), 0xFFFEu);
  EXPECT_EQ(raw(-1.0), 0u);
  EXPECT_EQ(raw(-kInfinity), 0u);
  EXPECT_EQ(raw(kNan), 0xFFFFu);
  EXPECT_TRUE(std::isnan(back_from(Message::kEncoder, false, "edge_age", kNan)));
  EXPECT_DOUBLE_EQ(back_from(Message::kEncoder, false, "edge_age", 1e9), 0.065534);
}

// Catches: undefined conversions to single, an overflow that becomes a plausible number, a lost sign of zero.
TEST(CanCodec, ASingleOverflowsToInfinityAndKeepsItsSign) {
  const auto raw = [](double value) { return raw_of(Message::kSensors, true, "i_a", value); };
  constexpr double kLargest = 3.4028234663852886e38;
  EXPECT_EQ(raw(kLargest), 0x7F7F'FFFFu);
  EXPECT_EQ(raw(std::nextafter(kLargest, kMax)), 0x7F80'0000u);
  EXPECT_EQ(raw(kMax), 0x7F80'0000u);
  EXPECT_EQ(raw(-kMax), 0xFF80'0000u);
  EXPECT_EQ(raw(-kInfinity), 0xFF80'0000u);
  EXPECT_EQ(raw(-0.0), 0x8000'0000u);
  EXPECT_EQ(raw(1.4e-45), 1u);
  EXPECT_EQ(raw(kDenormal), 0u);
  EXPECT_EQ(raw(kNan) & 0x7FC0'0000u, 0x7FC0'0000u);
  EXPECT_TRUE(std::isnan(back_from(Message::kSensors, true, "i_a", kNan)));
}

// Catches: a unit of the profile that is ignored, or used for another quantity.
TEST(CanCodec, EachQuantityHasItsUnit) {
  Profile profile = profile_of(false);
  profile.current_unit_a = 2.0;
  profile.voltage_unit_v = 3.0;
  profile.bus_voltage_unit_v = 5.0;
  profile.speed_unit_rad_s = 7.0;
  profile.edge_time_unit_s = 11.0;
  const auto data = [&](Message message, Values values) {
    return data_of(encode(*find_message(message, false), profile, 1, values));
  };
  EXPECT_EQ(data(Message::kCurrents, {8, 8}), "0400040000000000");
  EXPECT_EQ(data(Message::kCommand, {9, 9, 0, 1}), "0300030000000100");
  EXPECT_EQ(data(Message::kState, {14, 15}), "0200030000000000");
  EXPECT_EQ(data(Message::kEncoder, {0, 11, 22}), "0000000001000200");
}

// Catches: duties that are taken for volts on one side, and a full duty that is not 1.
TEST(CanCodec, InModeThreeACommandCarriesDuties) {
  const MessageRow& row = *find_message(Message::kCommand, false);
  const Profile profile = profile_of(false);
  const Frame frame = encode(row, profile, 1, Values{1.0, -0.5, 7, kDutyMode, 0, 1});
  EXPECT_EQ(data_of(frame), "FF7F00C007000301");
  const Values values = decode(row, profile, frame);
  EXPECT_EQ(values[0], 1.0);
  EXPECT_NEAR(values[1], -0.5, kDutyUnit);
  EXPECT_EQ(data_of(encode(row, profile, 1, Values{-2.0, kNan, 7, kDutyMode, 0, 1})), "0180008007000301");
}

// Mode and legs share a byte. Catches: half a byte that overwrites the other one, a leg that is taken for a
// mode, duties of legs that are scaled as volts.
TEST(CanCodec, ACommandCarriesDutiesOfLegsAndTheLegsThatAreOff) {
  const MessageRow& row = *find_message(Message::kCommand, false);
  const Profile profile = profile_of(false);
  const Frame frame = encode(row, profile, 1, Values{1.0, 0.0, 7, kLegDutyMode, 5, 1});
  EXPECT_EQ(data_of(frame), "FF7F000007005501");
  const Values values = decode(row, profile, frame);
  EXPECT_EQ(values[0], 1.0);
  EXPECT_EQ(values[index_of(row, "mode")], kLegDutyMode);
  EXPECT_EQ(values[index_of(row, "legs_off")], 5.0);
  const Values fd = {0x12345, 1.0, 0.0, kLegDutyMode, 2, 9};
  EXPECT_EQ(data_of(encode(*find_message(Message::kCommand, true), profile_of(true), 1, fd)),
            "45230100"
            "0000803F"
            "00000000"
            "25090000");
}

// Catches: any field that does not come back as it was sent: all patterns of all fields, but for a NaN's
// payload.
TEST(CanCodec, EveryFrameComesBackAsItWas) {
  std::mt19937_64 random(11);
  for (const MessageRow& row : kMessages) {
    const Profile profile = profile_of(row.variant == Variant::kFd);
    for (int round = 0; round < 3000; ++round) {
      Frame frame = encode(row, profile, 9, Values{});
      const auto page = is_paged(row) ? static_cast<std::uint8_t>(random() % (kPages + 1)) : std::uint8_t{0};
      for (const Field& field : row.fields) {
        for (unsigned bit = 0; bit < field.bits && is_on_page(field, page); bit += 8) {
          frame.data[(field.start_bit + bit) / 8U] =
              static_cast<std::uint8_t>(random() % 4 == 0 ? 0xFF : random());
        }
      }
      if (is_paged(row)) frame.data[0] = page;
      const Values values = decode(row, profile, frame);
      const Frame again = encode(row, profile, 9, values);
      for (std::size_t i = 0; i < row.fields.size(); ++i) {
        const Field& field = row.fields[i];
        if (field.encoding == Encoding::kFloat && std::isnan(values[i])) continue;
        if (!is_on_page(field, page)) {
          ASSERT_EQ(values[i], 0.0) << row.name << " " << field.name;
          continue;
        }
        for (unsigned bit = 0; bit < field.bits; bit += 8) {
          const std::size_t byte = (field.start_bit + bit) / 8U;
          ASSERT_EQ(again.data[byte], frame.data[byte]) << row.name << " " << field.name;
        }
      }
    }
  }
}

// Catches: a signal that goes to another field, or to none; more than half a count of error, or half a bit of
// a single.
TEST(CanCodec, RandomSamplesComeBack) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (const auto& [fd, wide] : {std::pair(false, false), {false, true}, {true, false}, {true, true}}) {
    for (int round = 0; round < 2000; ++round) {
      Sample sample = a_sample();
      sample.tick = random() >> 12;
      sample.command_tick = static_cast<std::int64_t>(sample.tick) - 1;
      sample.missed_commands = random() >> 12;
      sample.refused_commands = random() >> 12;
      sample.late_ticks = random() >> 12;
      sample.encoder_count = static_cast<std::int64_t>(random()) >> 12;
      sample.index_count = static_cast<std::int64_t>(random()) >> 12;
      sample.index_tick = static_cast<std::int64_t>(random() >> 12);
      sample.i_a_a = 30.0 * uniform(random);
      sample.edge_age_s = 0.03 + 0.03 * uniform(random);
      sample.speed_rad_s = 3000.0 * uniform(random);
      sample.i_c_a = 30.0 * uniform(random);
      sample.u_f_v = 300.0 * uniform(random);
      sample.resolver_cos_v = 30.0 * uniform(random);
      sample.temperature_k = 3000.0 + 3000.0 * uniform(random);
      sample.hall_lines = random() % 8;
      sample.injected = random() >> 36;
      Sample received = sample;  // known a little earlier
      received.tick -= 50;
      received.command_tick -= 50;
      received.missed_commands -= 100;
      received.late_ticks -= 100;
      received.encoder_count -= 20'000;
      received.index_count += 20'000;
      received.index_tick -= 50;
      received.i_a_a = received.edge_age_s = received.speed_rad_s = kNan;
      received.i_c_a = received.u_f_v = received.resolver_cos_v = received.temperature_k = kNan;
      received.state = received.faults = received.encoder_levels = 99;
      received.hall_lines = received.injected = 99;
      for (const MessageRow& row : kMessages) {
        if (find_message(row.message, fd, wide) != &row || row.sender != Sender::kBench) continue;
        for (std::size_t page = 0; page < (is_paged(row) ? kPages : 1); ++page) {
          const Frame frame = encode_sample(row, profile_of(fd), 1, sample, static_cast<Page>(page));
          update_sample(row, decode(row, profile_of(fd), frame), received);
        }
      }
      const Profile units;
      EXPECT_EQ(received.tick, sample.tick);
      EXPECT_EQ(received.command_tick, sample.command_tick);
      EXPECT_EQ(received.missed_commands, sample.missed_commands);
      EXPECT_EQ(received.late_ticks, sample.late_ticks);
      EXPECT_EQ(received.encoder_count, sample.encoder_count);
      EXPECT_EQ(received.index_count, sample.index_count);
      EXPECT_EQ(received.index_tick, sample.index_tick);
      EXPECT_EQ(received.state, sample.state);
      EXPECT_EQ(received.faults, sample.faults);
      EXPECT_EQ(received.encoder_levels, sample.encoder_levels);
      const double half = fd ? 0.0 : 0.5000001;
      EXPECT_NEAR(received.i_a_a, sample.i_a_a, half * units.current_unit_a + 2e-6);
      EXPECT_NEAR(received.edge_age_s, sample.edge_age_s, half * units.edge_time_unit_s + 1e-8);
      EXPECT_NEAR(received.speed_rad_s, sample.speed_rad_s, half * units.speed_unit_rad_s + 2e-4);
      EXPECT_EQ(received.owner, sample.owner) << "in no frame";
      EXPECT_EQ(std::isnan(received.i_c_a), !wide);
      if (!wide) continue;
      EXPECT_NEAR(received.i_c_a, sample.i_c_a, half * units.current_unit_a + 2e-6);
      EXPECT_NEAR(received.u_f_v, sample.u_f_v, half * units.voltage_unit_v + 2e-5);
      EXPECT_NEAR(received.resolver_cos_v, sample.resolver_cos_v, half * 1e-3 + 1e-6);
      EXPECT_NEAR(received.temperature_k, sample.temperature_k, half * 0.1 + 3e-4);
      EXPECT_EQ(received.hall_lines, sample.hall_lines);
      EXPECT_EQ(received.injected, sample.injected);
    }
  }
}

// Catches: an edge in the wrong place, or a time that spills into the direction.
TEST(CanCodec, EdgesHaveTheirPlaces) {
  Frame frame = sent(Message::kEdges, true);
  put_edge(frame, 0, {0x1234, true});
  put_edge(frame, kEdgesPerFrame - 1, {0x7FFF, false});
  EXPECT_EQ(data_of(frame), std::string(24, '0') + "3492" + std::string(96, '0') + "FF7F");
  EXPECT_EQ(edge_at(frame, 0), (Edge{0x1234, true}));
  EXPECT_EQ(edge_at(frame, 1), (Edge{0, false}));
  EXPECT_EQ(edge_at(frame, kEdgesPerFrame - 1), (Edge{0x7FFF, false}));
}

}  // namespace
}  // namespace drivebench::can::can_codec_test
