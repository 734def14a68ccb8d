#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "protocols/modbus/drive_profile.hpp"
#include "protocols/modbus/map_text.hpp"
#include "protocols/modbus/mbap.hpp"
#include "protocols/modbus/pdu.hpp"
#include "protocols/modbus/register_map.hpp"

namespace drivebench::modbus::modbus_map_test {
namespace {

constexpr auto kParameters = std::to_array<ParameterInfo>({
    {"machine.a", "ohm", 0.5, 2.0, true, "a real"},
    {"machine.b", "1", 0.0, 1.0, true, "a \"switch\", two | words"},
    {"machine.c", "1", 0.0, 9.0, false, "fixed"},
});

const RegisterMap& map() {
  static const RegisterMap whole(kParameters, true);
  return whole;
}

std::span<const RegisterMap> one(const RegisterMap& map) {
  return {&map, 1};
}

// Catches: bytes or words in another order than ABCD, the order of the standard and of our documents.
TEST(ModbusCodec, ValuesLieInRegistersInTheOrderABCD) {
  std::uint16_t words[4] = {};
  put(float_bits(1.2345678), Type::kFloat32, WordOrder::kAbcd, words);
  EXPECT_EQ(words[0], 0x3f9e);
  EXPECT_EQ(words[1], 0x0651);
  put(float_bits(1.2345678), Type::kFloat32, WordOrder::kCdab, words);
  EXPECT_EQ(words[0], 0x0651);
  EXPECT_EQ(words[1], 0x3f9e);
  put(0x0102030405060708u, Type::kUnsigned64, WordOrder::kAbcd, words);
  EXPECT_EQ(words[0], 0x0102);
  EXPECT_EQ(words[3], 0x0708);
  put(0x0102030405060708u, Type::kUnsigned64, WordOrder::kCdab, words);
  EXPECT_EQ(words[0], 0x0708);
  EXPECT_EQ(words[3], 0x0102);
  for (const WordOrder order : {WordOrder::kAbcd, WordOrder::kCdab}) {
    put(static_cast<std::uint64_t>(std::int64_t{-123456789}), Type::kSigned32, order, words);
    EXPECT_EQ(number_of(Type::kSigned32, get(Type::kSigned32, order, words)), -123456789.0);
    put(static_cast<std::uint64_t>(std::int64_t{-5}), Type::kSigned64, order, words);
    EXPECT_EQ(number_of(Type::kSigned64, get(Type::kSigned64, order, words)), -5.0);
  }
  EXPECT_EQ(number_of(Type::kSigned16, 0xfffe), -2.0);
  EXPECT_EQ(number_of(Type::kUnsigned16, 0xfffe), 65534.0);
}

// Catches: a scaled value that wraps around, or a NaN that looks like a number.
TEST(ModbusCodec, ScaledValuesSaturateAndNanIsNoNumber) {
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(counts_of(Type::kSigned16, -1.006, 0.01), 0xff9bu) << "rounded";
  EXPECT_EQ(counts_of(Type::kSigned16, 1e9, 0.01), 32767u);
  EXPECT_EQ(counts_of(Type::kSigned16, -inf, 0.01), 0x8001u);
  EXPECT_EQ(counts_of(Type::kSigned16, std::nan(""), 0.01), 0x8000u);
  EXPECT_EQ(counts_of(Type::kUnsigned16, -3.0, 0.1), 0u);
  EXPECT_EQ(counts_of(Type::kUnsigned16, inf, 0.1), 65534u);
  EXPECT_EQ(counts_of(Type::kUnsigned16, std::nan(""), 0.1), 65535u);
}

// Catches: a signal that is missing or listed twice, an address that moved although the version did not.
TEST(ModbusMap, EverySignalStandsInTheSampleBlockOnce) {
  std::multiset<std::string_view> names;
  for (const Row& row : map().rows())
    if (row.content == Content::kSignal && row.address >= kSampleStart) names.insert(row.name);
  EXPECT_EQ(names.size(), kSignals.size());
  for (const Signal& signal : kSignals)
    EXPECT_EQ(names.count(signal.name), 1u) << signal.name;
  const auto address_of = [](std::string_view name) {
    const auto row = std::find_if(map().rows().begin(), map().rows().end(),
                                  [&](const Row& r) { return r.name == name && r.address >= kSampleStart; });
    return row == map().rows().end() ? 0 : int{row->address};
  };
  EXPECT_EQ(kMapVersion, 1) << "with a new version come new addresses here";
  EXPECT_EQ(address_of("tick"), 200);
  EXPECT_EQ(address_of("owner"), 232);
  EXPECT_EQ(address_of("edge_age_s"), 244);
  EXPECT_EQ(address_of("i_a_a"), 256);
  EXPECT_EQ(address_of("speed_rad_s"), 266);
  EXPECT_EQ(address_of("bus_voltage_v"), 280);
  EXPECT_EQ(address_of("snapshot"), 282);
  EXPECT_EQ(address_of("i_c_a"), 286);
  EXPECT_EQ(address_of("hall_lines"), 296);
  EXPECT_EQ(address_of("temperature_k"), 306);
  EXPECT_EQ(address_of("meter_pf"), 316);
  EXPECT_EQ(address_of("injected"), 318);
  EXPECT_EQ(address_of("true_i_c_a"), 322);
  EXPECT_EQ(address_of("load_position_m"), 330);
  EXPECT_EQ(address_of("last_snapshot"), 332);
  EXPECT_EQ(address_of("lease_key"), 400);
  EXPECT_EQ(address_of("command_counter"), 403);
  EXPECT_EQ(address_of("command_c"), 429);
  EXPECT_EQ(address_of("command_field"), 431);
  EXPECT_EQ(address_of("rail_snapshot"), 340);
  EXPECT_EQ(address_of("terminal_a_v"), 344);
  EXPECT_EQ(address_of("terminal_c_mean_v"), 354);
  EXPECT_EQ(address_of("comparator_snapshot"), 360);
  EXPECT_EQ(address_of("comparator_levels"), 364);
  EXPECT_EQ(address_of("comparator_c_v"), 390);
  EXPECT_EQ(address_of("legs_off"), 433);
  EXPECT_EQ(address_of("converter_snapshot"), 440);
  EXPECT_EQ(address_of("i_a_counts"), 444);
  EXPECT_EQ(address_of("encoder_capture"), 480);
  EXPECT_EQ(address_of("position_snapshot"), 490);
  EXPECT_EQ(address_of("absolute_angle"), 494);
  EXPECT_EQ(address_of("hall_capture"), 504);
  EXPECT_EQ(address_of("machine.b"), 1002);
}

// Catches: process data of phase c, the field, the Hall lines or the injected faults at another address or
// scale.
TEST(ModbusMap, TheProcessDataOfAllTerminalsHaveTheseAddresses) {
  struct Place {
    std::uint16_t address;
    std::string_view name;
    double scale;
  };
  const auto places = std::to_array<Place>({{122, "reference_mode", 1.0},
                                            {125, "reference_c", 0.01},
                                            {126, "reference_field", 0.01},
                                            {131, "i_c_a", 0.01},
                                            {132, "i_f_a", 0.01},
                                            {135, "temperature_k", 0.1},
                                            {136, "hall_lines", 1.0},
                                            {138, "injected_low", 1.0},
                                            {141, "more_snapshot", 1.0}});
  for (const Place& place : places) {
    const auto row = std::find_if(map().rows().begin(), map().rows().end(),
                                  [&](const Row& each) { return each.address == place.address; });
    ASSERT_NE(row, map().rows().end()) << place.name;
    EXPECT_EQ(row->name, place.name);
    EXPECT_EQ(row->scale, place.scale) << place.name;
  }
}

// The terminals against the negative rail, the comparators, and converters and timers have blocks of their
// own, with the tick. Catches: other sensors that one request cannot read together with the tick.
TEST(ModbusMap, OneRequestReadsEverySensor) {
  EXPECT_LE(kSensorsLength, 125);
  EXPECT_EQ(kSampleStart + kSensorsLength, 324);
  EXPECT_TRUE(map().find(kSampleStart, kSensorsLength));
  for (const Row& row : map().rows()) {
    if (row.content != Content::kSignal || row.address < kSampleStart) continue;
    if (kSignals[row.index].kind == SignalKind::kTruth) continue;
    if (row.index >= map_detail::kBeforeRail) continue;
    EXPECT_LE(row.end(), std::size_t{kSampleStart} + kSensorsLength) << row.name;
  }
}

// Catches: a block for all terminals that puts another value in the place of one of the first block, or
// leaves one out: a client of the first block must be able to read the other.
TEST(ModbusMap, TheBlocksForAllTerminalsRepeatTheFirstOnes) {
  const auto row_at = [](std::uint16_t address) {
    const auto row = std::find_if(map().rows().begin(), map().rows().end(),
                                  [&](const Row& each) { return each.address == address; });
    return row == map().rows().end() ? Row{} : *row;
  };
  for (std::uint16_t address = 400; address < 409; ++address) {
    const Row first = row_at(address);
    const Row again = row_at(static_cast<std::uint16_t>(address + 20));
    EXPECT_EQ(first.content, again.content) << address;
    EXPECT_EQ(first.type, again.type) << address;
    EXPECT_EQ(first.maximum, again.maximum) << address;
    EXPECT_EQ((first.name.empty() ? "" : "more_") + std::string(first.name), again.name);
  }
  for (const Row& row : map_detail::kProcess) {
    const auto same = [&](const Row& other) {
      return other.content == row.content && other.index == row.index && other.scale == row.scale &&
             other.type == row.type && other.writable == row.writable;
    };
    EXPECT_TRUE(std::any_of(map_detail::kMoreProcess.begin(), map_detail::kMoreProcess.end(), same))
        << row.name;
  }
}

// Catches: rows that overlap, a block header that does not describe its block, an address above the mirror.
TEST(ModbusMap, TheBlocksHoldTheRowsWithoutAGap) {
  std::size_t next = 0;
  for (const Row& row : map().rows()) {
    EXPECT_GE(row.address, next) << row.name;
    const bool begins_block = std::any_of(map().blocks().begin(), map().blocks().end(),
                                          [&](const Block& block) { return block.start == row.address; });
    EXPECT_TRUE(begins_block || row.address == next) << row.name;
    next = row.end();
  }
  EXPECT_LE(next, kMirrorOffset);
  for (const Block& block : map().blocks()) {
    EXPECT_TRUE(map().find(block.start, block.length)) << block.name;
    // Two blocks alone follow on another.
    EXPECT_EQ(map().find(block.start, static_cast<std::uint16_t>(block.length + 1)).has_value(),
              block.id == 2 || block.id == 7)
        << block.name;
    EXPECT_EQ(map().find(static_cast<std::uint16_t>(block.start - 1), 2).has_value(),
              block.id == 6 || block.id == 8)
        << block.name;
  }
  EXPECT_FALSE(map().find(100, 100)) << "over a gap";
  EXPECT_FALSE(map().find(12, 60'000)) << "beyond the end";
}

// Catches: a bit of the encoder, the Hall lines or the injected faults at another's input.
TEST(ModbusMap, EveryDiscreteInputHasItsBit) {
  for (std::size_t input = 0; input < kDiscreteInputs; ++input) {
    Sample sample;
    sample.state = 99;
    if (input < 16) sample.faults = std::uint64_t{1} << input;
    if (input >= 16 && input < 22) sample.state = input - 16;
    if (input >= 22 && input < 28) sample.encoder_levels = std::uint64_t{1} << (input - 22);
    if (input >= 28 && input < 31) sample.hall_lines = std::uint64_t{1} << (input - 28);
    if (input >= 31) sample.injected = std::uint64_t{1} << (input - 31);
    for (std::size_t other = 0; other < kDiscreteInputs; ++other)
      EXPECT_EQ(discrete_input(other, sample), other == input) << input << " " << other;
  }
  EXPECT_EQ(kDiscreteInputs, 63u);
}

// Catches: a sample that loses a signal, a sign or the upper half of a counter between the ends of the wire.
TEST(ModbusMap, ASampleComesBackAsItWasButForFloatRounding) {
  Sample sample;
  double value = 0.7;
  for (const Signal& signal : kSignals) {
    value *= -1.9;
    if (signal.type == SignalType::kUnsigned)
      sample.*signal.as_unsigned = std::bit_cast<std::uint64_t>(value);
    if (signal.type == SignalType::kSigned) sample.*signal.as_signed = std::bit_cast<std::int64_t>(value);
    if (signal.type == SignalType::kReal) sample.*signal.as_real = value;
  }
  std::vector<std::uint16_t> words(map_detail::kPosition.back().end() - kSampleStart);
  for (const Row& row : map_detail::kSample)
    put(signal_bits(row, sample), row.type, WordOrder::kAbcd, &words[row.address - kSampleStart]);
  for (const Row& row : map_detail::kMoreSample)
    put(signal_bits(row, sample), row.type, WordOrder::kAbcd, &words[row.address - kSampleStart]);
  for (const Row& row : map_detail::kRailSample)
    put(signal_bits(row, sample), row.type, WordOrder::kAbcd, &words[row.address - kSampleStart]);
  for (const Row& row : map_detail::kComparators)
    put(signal_bits(row, sample), row.type, WordOrder::kAbcd, &words[row.address - kSampleStart]);
  for (const Row& row : map_detail::kConverters)
    put(signal_bits(row, sample), row.type, WordOrder::kAbcd, &words[row.address - kSampleStart]);
  for (const Row& row : map_detail::kPosition)
    put(signal_bits(row, sample), row.type, WordOrder::kAbcd, &words[row.address - kSampleStart]);
  const Sample back = read_sample(words);
  const Sample first = read_sample(std::span(words).first(kSampleLength));
  EXPECT_EQ(first.bus_voltage_v, back.bus_voltage_v);
  EXPECT_EQ(first.i_c_a, 0.0) << "not among the words";
  for (const Signal& signal : kSignals) {
    switch (signal.type) {
      case SignalType::kUnsigned:
        EXPECT_EQ(back.*signal.as_unsigned, sample.*signal.as_unsigned) << signal.name;
        break;
      case SignalType::kSigned:
        EXPECT_EQ(back.*signal.as_signed, sample.*signal.as_signed) << signal.name;
        break;
      case SignalType::kReal:
        EXPECT_EQ(back.*signal.as_real, static_cast<double>(static_cast<float>(sample.*signal.as_real)))
            << signal.name;
        break;
    }
  }
}

// Catches: a state that cannot be reached, or cannot be left, against the standard.
TEST(ModbusDriveProfile, TheTransitionsAreThoseOfTheStandard) {
  using enum DriveState;
  struct Case {
    DriveState from;
    std::uint16_t word;
    DriveState to;
  };
  for (const Case& c : std::to_array<Case>({
           {kSwitchOnDisabled, 0x06, kReadyToSwitchOn},  // 2
           {kSwitchOnDisabled, 0x07, kSwitchOnDisabled},
           {kSwitchOnDisabled, 0x0f, kSwitchOnDisabled},
           {kReadyToSwitchOn, 0x07, kSwitchedOn},        // 3
           {kReadyToSwitchOn, 0x0f, kOperationEnabled},  // 3 and 4
           {kSwitchedOn, 0x0f, kOperationEnabled},       // 4
           {kOperationEnabled, 0x07, kSwitchedOn},       // 5
           {kSwitchedOn, 0x06, kReadyToSwitchOn},        // 6
           {kReadyToSwitchOn, 0x00, kSwitchOnDisabled},  // 7
           {kReadyToSwitchOn, 0x02, kSwitchOnDisabled},
           {kOperationEnabled, 0x06, kReadyToSwitchOn},   // 8
           {kOperationEnabled, 0x00, kSwitchOnDisabled},  // 9
           {kSwitchedOn, 0x00, kSwitchOnDisabled},        // 10
           {kSwitchedOn, 0x02, kSwitchOnDisabled},
           {kOperationEnabled, 0x02, kQuickStopActive},  // 11
           {kQuickStopActive, 0x00, kSwitchOnDisabled},  // 12
           {kQuickStopActive, 0x0f, kOperationEnabled},  // 16
           {kQuickStopActive, 0x07, kQuickStopActive},
           {kQuickStopActive, 0x06, kQuickStopActive},
           {kFault, 0x0f, kFault},
           {kFault, 0x80, kFault},
       })) {
    EXPECT_EQ(next_state(c.from, c.word), c.to) << "from " << int(c.from) << " by " << c.word;
  }
  EXPECT_EQ(status_word(kOperationEnabled, {true, false, true, false}), 0x0237);
  EXPECT_EQ(status_word(kFault, {false, true, false, true}), 0x0888);
}

// Catches: a frame that is cut wrongly, a bad header that is passed over.
TEST(ModbusFraming, FramesComeOutWholeHoweverTheStreamWasCut) {
  const std::vector<std::uint8_t> stream{0, 1, 0, 0, 0, 6,   1, 3, 0, 0, 0, 1, 0,
                                         2, 0, 0, 0, 2, 255, 7, 0, 3, 0, 0, 0, 1};
  for (std::size_t piece = 1; piece <= stream.size(); ++piece) {
    MbapReader reader;
    std::vector<std::size_t> sizes;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      const std::size_t count = std::min(piece, stream.size() - at);
      std::copy_n(stream.begin() + static_cast<std::ptrdiff_t>(at), count, reader.free_space().begin());
      reader.received(count);
      while (const auto adu = reader.next())
        sizes.push_back(adu->size());
    }
    EXPECT_EQ(sizes, (std::vector<std::size_t>{12, 8}));
    EXPECT_EQ(reader.error(), "the length is not 2 to 254");
    EXPECT_FALSE(reader.next());
  }
}

// Catches: a reader that waits for the announced bytes of a bad header before it refuses.
TEST(ModbusFraming, ABadHeaderIsRecognisedFromItsFirstSixBytes) {
  const auto error_of = [](std::initializer_list<std::uint8_t> header) {
    MbapReader reader;
    std::copy(header.begin(), header.end(), reader.free_space().begin());
    reader.received(header.size());
    EXPECT_FALSE(reader.next());
    return std::string(reader.error());
  };
  EXPECT_EQ(error_of({0, 1, 0, 0, 0, 2}), "");
  EXPECT_EQ(error_of({0, 1, 0, 0, 0, 254}), "");
  EXPECT_EQ(error_of({0, 1, 0, 0, 0, 1}), "the length is not 2 to 254");
  EXPECT_EQ(error_of({0, 1, 0, 0, 0, 255}), "the length is not 2 to 254");
  EXPECT_EQ(error_of({0, 1, 0, 0, 255, 255}), "the length is not 2 to 254");
  EXPECT_EQ(error_of({0, 1, 0, 1, 0, 6}), "the protocol id is not 0");
  EXPECT_EQ(error_of({0, 1, 1, 0, 0, 6}), "the protocol id is not 0");
}

// Catches: a map for people that differs from the one that is served.
TEST(ModbusMapText, TheTextsHaveALineForEveryValue) {
  const auto faults =
      std::to_array<FaultInput>({{.address = 8, .bit = {"over_current_trip", "latched"}},
                                 {.address = kFirstInjectedInput + 5, .bit = {"leg_stuck_off", "injected"}}});
  const auto axes = std::to_array<std::string_view>({"left", "right"});
  const std::string csv = map_csv(one(map()), faults);
  const std::string markdown = map_markdown(one(map()), faults, axes);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'),
            std::ptrdiff_t(1 + map().rows().size() + kCoils.size() + 2 + kOtherInputs.size()));
  EXPECT_NE(csv.find("\nregister,102,0x0066,30103,40103,10102,reference_a,voltage of phase a while operation "
                     "is enabled,int16,rw,V,"
                     "0.01,-327.68 .. 327.67\n"),
            std::string::npos);
  EXPECT_NE(csv.find("1002,0x03ea,31003,41003,11002,machine.b,\"a \"\"switch\"\", two | "
                     "words\",float32,rw,1,1,0 .. 1\n"),
            std::string::npos);
  EXPECT_NE(csv.find("\ndiscrete input,8,0x0008,10009,,,over_current_trip,latched,bit,r,"),
            std::string::npos);
  EXPECT_NE(csv.find("\ndiscrete input,36,0x0024,10037,,,leg_stuck_off,injected,bit,r,"), std::string::npos);
  EXPECT_NE(markdown.find("| 1004 | 0x03ec | 31005 | 41005 | 11004 | machine.c | fixed | float32 | r |"),
            std::string::npos);
  EXPECT_NE(markdown.find("two \\| words"), std::string::npos);
  EXPECT_NE(markdown.find("* unit id 2: axis 1, right\n"), std::string::npos);
  EXPECT_NE(markdown.find("\n## Parameters\n"), std::string::npos);
  const RegisterMap read_only(kParameters, false);
  EXPECT_EQ(map_csv(one(read_only), faults).find(",rw,"), std::string::npos);
}

// Catches: parameters of one kind of machine shown for an axis with another.
TEST(ModbusMapText, AxesOfDifferentKindsHaveTheirOwnParameters) {
  constexpr auto kOthers =
      std::to_array<ParameterInfo>({{"machine.z", "V", 0.0, 9.0, true, "of the other kind"}});
  const std::array<RegisterMap, 2> maps = {map(), RegisterMap(kOthers, true)};
  const std::string csv = map_csv(maps, {});
  EXPECT_NE(csv.find("\nregister,400,"), std::string::npos);
  EXPECT_EQ(csv.find("\nregister,1000,"), std::string::npos);
  EXPECT_NE(csv.find("\nregister of unit 1,1004,0x03ec,31005,41005,11004,machine.c,"), std::string::npos);
  EXPECT_NE(csv.find("\nregister of unit 2,1000,0x03e8,31001,41001,11000,machine.z,"), std::string::npos);
  EXPECT_EQ(csv.find("\nregister,400,", csv.find("\nregister,400,") + 1), std::string::npos) << "once";
  const std::string markdown = map_markdown(maps, {}, {});
  const std::size_t second = markdown.find("\n## Parameters of unit id 2\n");
  EXPECT_NE(second, std::string::npos);
  EXPECT_NE(markdown.find("machine.z", second), std::string::npos);
  EXPECT_LT(markdown.find("machine.c"), second);
}

}  // namespace
}  // namespace drivebench::modbus::modbus_map_test
