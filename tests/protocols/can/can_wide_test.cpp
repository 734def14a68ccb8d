// Axes that have more than phases a and b and an encoder: their frames, identifiers, DBC file and bus budget.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "protocols/can/budget.hpp"
#include "protocols/can/codec.hpp"
#include "protocols/can/dbc.hpp"
#include "protocols/can/table_text.hpp"
#include "protocols/signals/catalogue.hpp"
#include "tests/protocols/can/can_sample.hpp"

namespace drivebench::can::can_wide_test {
namespace {

Frame sent_by_wide(Message message, bool fd, Page page = Page{}) {
  return encode_sample(*find_message(message, fd, true), profile_of(fd), 5, a_sample(), page);
}

// Catches: a place, scale or page of the wide axes' frames that changes.
TEST(CanCodec, ClassicFramesOfWideAxesHaveTheseBytes) {
  EXPECT_EQ(data_of(sent_by_wide(Message::kPhases, false)), "DC050CFE89670500");
  EXPECT_EQ(data_of(sent_by_wide(Message::kDetails, false, Page::kVoltages)), "0089E80330F8F401");
  EXPECT_EQ(data_of(sent_by_wide(Message::kDetails, false, Page::kField)), "018960099CFFB80B");
  EXPECT_EQ(data_of(sent_by_wide(Message::kDetails, false, Page::kSpeedSensors)), "0289C800F40106FF");
  EXPECT_EQ(data_of(sent_by_wide(Message::kDetails, false, Page::kInjected)), "0389010000080000");
  const MessageRow& row = *find_message(Message::kPhaseCommand, false, true);
  EXPECT_EQ(data_of(encode(row, profile_of(false), 1, Values{-12.34, 0.5, 0x12345, 1, 200})),
            "2EFB3200452301C8");
}

// Catches: a wide frame that does not begin like the narrow one: a client that knows the narrow part reads
// both.
TEST(CanCodec, FdFramesOfWideAxesBeginAsThoseOfNarrowOnes) {
  EXPECT_EQ(data_of(sent_by_wide(Message::kSensors, true)), data_of(sent(Message::kSensors, true)) +
                                                                "0000C03F"
                                                                "000000BF"
                                                                "00004042"
                                                                "00000040"
                                                                "0000003F"
                                                                "000080BE"
                                                                "00009643"
                                                                "05000000");
  EXPECT_EQ(data_of(sent_by_wide(Message::kDetails, true)),
            "89674523"
            "00002041"
            "0000A0C1"
            "0000A040"
            "0000C041"
            "000080BF"
            "00006643"
            "00002040"
            "0000FA43"
            "0000FAC2"
            "0000403F"
            "01000008");
  const Values command = {0x12345, 1.5, -0.25, 4, 0, 9, 0.5, -2.0};
  const Frame narrow = encode(*find_message(Message::kCommand, true), profile_of(true), 1, command);
  const Frame wide = encode(*find_message(Message::kCommand, true, true), profile_of(true), 1, command);
  EXPECT_EQ(data_of(wide), data_of(narrow) + "0000003F" + "000000C0");
  EXPECT_EQ(wide.id, narrow.id);
}

// Catches: currents that are scaled as voltages on one side, in the command or in what goes before it.
TEST(CanCodec, InModeFourACommandCarriesCurrents) {
  Profile profile = profile_of(false);
  profile.current_unit_a = 0.25;
  for (const Message message : {Message::kCommand, Message::kPhaseCommand}) {
    const MessageRow& row = *find_message(message, false, true);
    Values given{1.5, -2.0, 7, kCurrentMode};
    given[index_of(row, "lease")] = 1;
    const Frame frame = encode(row, profile, 1, given);
    EXPECT_EQ(data_of(frame), "0600F8FF07000401") << row.name;
    const Values values = decode(row, profile, frame);
    EXPECT_EQ(values[0], 1.5);
    EXPECT_EQ(values[1], -2.0);
  }
  const MessageRow& row = *find_message(Message::kPhaseCommand, false, true);
  EXPECT_EQ(data_of(encode(row, profile, 1, Values{1.0, -1.0, 7, kDutyMode, 1})), "FF7F018007000301");
}

// Catches: a page that is read into the signals of another one.
TEST(CanCodec, APageHoldsItsOwnSignalsOnly) {
  const MessageRow& row = *find_message(Message::kDetails, false, true);
  for (std::size_t page = 0; page < kPages; ++page) {
    Sample received;
    for (const Signal& signal : kSignals) {
      if (signal.type == SignalType::kReal) received.*signal.as_real = 7.0;
      if (signal.type == SignalType::kUnsigned) received.*signal.as_unsigned = 7;
    }
    received.tick = a_sample().tick;
    Sample expected = received;
    const Frame frame = sent_by_wide(Message::kDetails, false, static_cast<Page>(page));
    update_sample(row, decode(row, profile_of(false), frame), received);
    for (const Field& field : row.fields) {
      if (field.page != page) continue;
      const Signal& signal = *find_signal(field.signal);
      if (signal.type == SignalType::kReal) expected.*signal.as_real = a_sample().*signal.as_real;
      if (signal.type == SignalType::kUnsigned) expected.*signal.as_unsigned = a_sample().*signal.as_unsigned;
    }
    for (const Signal& signal : kSignals)
      EXPECT_DOUBLE_EQ(value_of(signal, received), value_of(signal, expected)) << page << " " << signal.name;
  }
}

// Catches: a message of a wide axis that is taken for the narrow one of the same identifier, or the other way
// round.
TEST(CanMatch, OnABusWithWideAxesEveryMessageIsRecognised) {
  for (const bool fd : {false, true}) {
    for (const MessageRow& row : kMessages) {
      if (!is_in(row, fd)) continue;
      for (std::uint32_t node = 1; node <= kMaxFreeNode; ++node) {
        const Match found =
            match(with_wide_axes(profile_of(fd)), encode(row, profile_of(fd), node, Values{}));
        EXPECT_TRUE(found.ok()) << row.name;
        EXPECT_EQ(found.row, &row) << row.name << " " << int{row.size};
        EXPECT_EQ(found.node, row.per_node ? node : 0);
      }
    }
  }
  Frame odd = sent(Message::kSensors, true);
  odd.size = 48;
  EXPECT_EQ(problem_of(with_wide_axes(profile_of(true)), odd), FrameProblem::kWrongSize);
}

// Catches: foreign frames that a bus without wide axes takes for those of wide axes; identifiers that such a
// bus uses otherwise and takes for those of wide axes.
TEST(CanMatch, WithoutWideAxesTheirIdentifiersAreFree) {
  for (const bool fd : {false, true}) {
    for (const Message message : {Message::kPhaseCommand, Message::kPhases, Message::kDetails}) {
      const MessageRow* const row = find_message(message, fd, true);
      EXPECT_EQ(find_message(message, fd), nullptr);
      if (row == nullptr) continue;
      EXPECT_EQ(problem_of(profile_of(fd), encode(*row, profile_of(fd), 3, Values{})),
                FrameProblem::kForeign);
    }
    const MessageRow& sensors = *find_message(Message::kSensors, true, true);
    EXPECT_EQ(problem_of(profile_of(true), encode(sensors, profile_of(true), 3, Values{})),
              FrameProblem::kWrongSize);
  }
  Profile profile = with_wide_axes(profile_of(false));
  profile.base_ids[static_cast<std::size_t>(Message::kState)] = 0x024;
  const MessageRow& state = *find_message(Message::kState, false);
  const Match found = match(profile, encode(state, profile, 1, Values{}));
  EXPECT_EQ(found.row, &state);
  EXPECT_EQ(found.node, 1u);
}

// Catches: identifiers of wide axes that another message has, noticed on the bus only; a bench without wide
// axes refused for them; a message of both kinds of axes that collides with itself.
TEST(CanProfile, IdentifiersOfWideAxesAreCheckedToo) {
  EXPECT_TRUE(problems(with_wide_axes(profile_of(false))).empty());
  EXPECT_TRUE(problems(with_wide_axes(profile_of(true))).empty());
  const auto with_id = [](Message message, std::uint32_t id, bool wide) {
    Profile profile = profile_of(true);
    profile.wide = wide;
    profile.base_ids[static_cast<std::size_t>(message)] = id;
    return problems(profile);
  };
  EXPECT_TRUE(with_id(Message::kIndex, 0x7A0, false).empty());
  EXPECT_EQ(with_id(Message::kIndex, 0x7A0, true).at(0).field, "ids.details");
  EXPECT_TRUE(with_id(Message::kSensors, 0x050, true).empty());
  EXPECT_EQ(with_id(Message::kSensors, 0x7FF, true).size(), 1u) << "once, not for both kinds of axes";
}

// Catches: frames of wide axes that are not counted, counted for narrow ones, or counted beside those that
// they replace.
TEST(CanBudget, WideAxesTakeMoreOfTheBus) {
  Profile profile;
  profile.fd = false;
  BusUse use;
  const double narrow = bus_load(profile, use).least_share;
  use.wide_axes = 1;
  const double once = 111e-6;
  EXPECT_NEAR(bus_load(profile, use).least_share, narrow + (2000 + 3 * 12.5) * once, 1e-9);
  use.sensing_axes = 1;
  EXPECT_NEAR(bus_load(profile, use).least_share, narrow + (3000 + 3 * 12.5) * once, 1e-9);

  use.axes = 3;
  profile.fd = true;
  const BusLoad load = bus_load(profile, use);
  double sensors = 0.0;
  double commands = 0.0;
  double details = 0.0;
  for (const MessageLoad& part : load.messages) {
    if (part.row->message == Message::kSensors) sensors += part.frames_per_s * part.row->size;
    if (part.row->message == Message::kCommand) commands += part.frames_per_s * part.row->size;
    if (part.row->message == Message::kDetails) details += part.frames_per_s;
  }
  EXPECT_NEAR(sensors, 2000 * 32 + 1000 * 64, 1e-9);
  EXPECT_NEAR(commands, 2000 * 16 + 1000 * 24, 1e-9);
  EXPECT_NEAR(details, 12.5, 1e-9);
}

// Catches: a DBC file that gives messages of wide axes to narrow ones; pages without DBC's mark of a
// multiplexer.
TEST(CanTexts, TheDbcFileListsTheSignalsOfEachAxis) {
  Profile profile;
  profile.fd = false;
  const std::vector<BusAxis> axes = {{"servo", 1, false}, {"bldc", 2, true}};
  std::string text = dbc_text("bench", profile, axes);
  EXPECT_TRUE(contains(text, "VERSION \"4\"\n"));
  EXPECT_FALSE(contains(text, "servo_details"));
  EXPECT_FALSE(contains(text, "servo_phase"));
  EXPECT_TRUE(contains(text, "BO_ 34 bldc_phase_command: 8 Controller\n SG_ u_c m1 : 0|16@1- (0.01,0)"));
  EXPECT_TRUE(contains(text, "BO_ 82 bldc_phases: 8 Bench\n"));
  EXPECT_TRUE(contains(text, "BO_ 1954 bldc_details: 8 Bench\n SG_ page M : 0|8@1+ (1,0) [0|255] \"\""));
  EXPECT_TRUE(contains(text, " SG_ u_b m0 : 32|16@1- (0.01,0) [-327.67|327.67] \"V\" Controller\n"));
  EXPECT_TRUE(contains(text, " SG_ injected m3 : 16|32@1+ (1,0)"));
  EXPECT_TRUE(contains(text, "VAL_ 1954 page 0 \"phase voltages\" 1 \"field and neutral\""));
  text = dbc_text("bench", profile, std::span(axes).first(1));
  EXPECT_TRUE(contains(text, "VERSION \"3\"\n"));

  profile.fd = true;
  text = dbc_text("bench", profile, axes);
  EXPECT_TRUE(contains(text, "BO_ 97 servo_sensors: 32 Bench\n"));
  EXPECT_TRUE(contains(text, "BO_ 98 bldc_sensors: 64 Bench\n"));
  EXPECT_TRUE(contains(text, "BO_ 50 bldc_command: 24 Controller\n"));
}

// Catches: a frame of a wide axis shown for all axes, a page without an example.
TEST(CanTexts, TheTableMarksTheFramesOfWideAxes) {
  Profile profile;
  const std::vector<BusAxis> axes = {{"servo", 1, false}, {"bldc", 2, true}};
  std::string text = table_text("bench", profile, axes);
  EXPECT_TRUE(contains(text, "Version 4 of the profile."));
  EXPECT_TRUE(contains(text, "| sensors (narrow axis) | bench | 0x061 | - |\n"));
  EXPECT_TRUE(contains(text, "| sensors (wide axis) | bench | - | 0x062 |\n"));
  EXPECT_TRUE(contains(text, "| command (wide axis) | `032##1E8030000"));
  profile.fd = false;
  text = table_text("bench", profile, axes);
  EXPECT_TRUE(contains(text, "| phases | bench | - | 0x052 |\n"));
  EXPECT_TRUE(
      contains(text, "| 2-3 | u_a | page 0: int16 x 0.01 | V | -327.67 to 327.67 | 0x8000 | voltage at"));
  EXPECT_TRUE(contains(text, "| details | `7A2#03E8200000000000` | page 3, tick 232, injected 32 |\n"));
}

}  // namespace
}  // namespace drivebench::can::can_wide_test
