#include <gtest/gtest.h>

#include <string>

#include "protocols/can/budget.hpp"
#include "protocols/can/dbc.hpp"
#include "protocols/can/table_text.hpp"
#include "tests/protocols/can/can_sample.hpp"

namespace drivebench::can::can_texts_test {
namespace {

void expect_time(const FrameTime& time, double least_us, double most_us) {
  EXPECT_NEAR(1e6 * time.least_s, least_us, 1e-6);
  EXPECT_NEAR(1e6 * time.most_s, most_us, 1e-6);
}

// Catches: a part of a frame that is not counted. The numbers are counted by hand from ISO 11898-1:2015; of
// the FD frames of more than 16 bytes with seven fixed stuff bits in 25 bits of stuff count and CRC.
TEST(CanBudget, AFrameTakesTheBitsOfTheStandard) {
  expect_time(frame_time(8, false, false, 1e6, 5e6), 111, 135);
  expect_time(frame_time(0, false, false, 1e6, 5e6), 47, 55);
  expect_time(frame_time(8, false, true, 1e6, 5e6), 131, 160);
  expect_time(frame_time(8, false, false, 5e5, 5e6), 222, 270);
  // 30 bits around the data, 5 and 27 or 32 with them; 4 stuff bits before them
  expect_time(frame_time(32, true, false, 1e6, 5e6), 30 + 293 / 5.0, 30 + 293 / 5.0 + 4 + 65 / 5.0);
  expect_time(frame_time(64, true, false, 1e6, 5e6), 30 + 549 / 5.0, 30 + 549 / 5.0 + 4 + 129 / 5.0);
  expect_time(frame_time(24, true, false, 1e6, 8e6), 30 + 229 / 8.0, 30 + 229 / 8.0 + 4 + 49 / 8.0);
  expect_time(frame_time(16, true, false, 1e6, 1e6), 30 + 160, 30 + 160 + 4 + 33);
  expect_time(frame_time(8, true, true, 1e6, 1e6), 49 + 96, 49 + 96 + 8 + 18);
}

const MessageLoad& load_of(const BusLoad& load, Message message) {
  for (const MessageLoad& part : load.messages) {
    if (part.row->message == message) return part;
  }
  ADD_FAILURE() << "not counted";
  return load.messages.at(0);
}

// Catches: a message, an axis or a rate that is left out of the sum.
TEST(CanBudget, TheLoadCountsEveryMessageSent) {
  Profile profile;
  profile.fd = false;
  BusUse use;
  BusLoad load = bus_load(profile, use);
  const double once = 111e-6;
  const double sync = 87e-6;  // 5 bytes
  const double heartbeats = 10 * (111e-6 + 55e-6);
  EXPECT_NEAR(load.least_share, 1000 * sync + 3000 * once + 2 * 12.5 * once + heartbeats, 1e-9);
  EXPECT_NEAR(load_of(load, Message::kCurrents).frames_per_s, 1000, 1e-9);

  use.axes = 2;
  EXPECT_NEAR(load_of(bus_load(profile, use), Message::kHeartbeat).frames_per_s, 20, 1e-9);
  use.sample_every_ticks = 2;
  use.heartbeat_ms = 0;
  load = bus_load(profile, use);
  EXPECT_NEAR(load.least_share, 500 * sync + 2 * 1500 * once + 4 * 12.5 * once, 1e-9);
  EXPECT_GT(load.most_share, 1.2 * load.least_share);

  profile.fd = true;
  use.edges = true;
  load = bus_load(profile, use);
  EXPECT_NEAR(load_of(load, Message::kEdges).frames_per_s, 2000, 1e-9);
  EXPECT_NEAR(load_of(load, Message::kSensors).frames_per_s, 1000, 1e-9);
  EXPECT_NEAR(load_of(load, Message::kState).frames_per_s, 25, 1e-9);
}

// Catches: rates that the documentation promises and that do not fit, or leave less than a third of the bus
// free.
TEST(CanBudget, TheDocumentedRatesFit) {
  Profile profile;
  profile.fd = false;
  EXPECT_LT(bus_load(profile, {.period_s = 1.0 / 1000}).most_share, 0.6);
  EXPECT_GT(bus_load(profile, {.period_s = 1.0 / 2000}).most_share, 1.0);
  profile.fd = true;
  EXPECT_LT(bus_load(profile, {.period_s = 1.0 / 2000}).most_share, 0.6);
  EXPECT_LT(bus_load(profile, {.period_s = 1.0 / 3000, .data_bit_rate = 8e6}).most_share, 0.6);
  EXPECT_GT(bus_load(profile, {.period_s = 1.0 / 8000}).most_share, 1.0);
  EXPECT_LT(bus_load(profile, {.wide_axes = 1, .period_s = 1.0 / 2000}).most_share, 0.65);
  EXPECT_LT(bus_load(profile, {.wide_axes = 1, .period_s = 1.0 / 3000, .data_bit_rate = 8e6}).most_share,
            0.75);
  profile.fd = false;
  EXPECT_LT(bus_load(profile, {.wide_axes = 1, .sensing_axes = 1, .period_s = 1.0 / 1000}).most_share, 1.0);
}

TEST(CanBudget, TheTextHasALineForEachMessageAndTheSum) {
  Profile profile;
  profile.fd = false;
  const std::string text = load_text(bus_load(profile, {}));
  EXPECT_NE(text.find("| currents | 1000.0 | 111 to 135 | 11.1 to 13.5 |\n"), std::string::npos) << text;
  EXPECT_NE(text.find("| all | 4045.0 |  | 42.4 to 51.5 |\n"), std::string::npos) << text;
}

// Catches: a list in the table that a loop reads differently from a reader.
TEST(CanTexts, EveryEnumeratedFieldListsItsChoices) {
  std::size_t seen = 0;
  for (const MessageRow& row : kMessages) {
    for (const Field& field : row.fields) {
      const std::vector<Choice> choices = choices_of(field);
      const bool is_given = field.signal == "faults" || field.signal == "injected";  // by the caller
      const bool lists = field.unit == "enum" || (field.unit == "bits" && !is_given);
      EXPECT_EQ(choices.size() >= 2, lists) << row.name << " " << field.name;
      for (std::size_t i = 1; i < choices.size(); ++i)
        EXPECT_GT(choices[i].number, choices[i - 1].number) << row.name << " " << field.name;
      if (!choices.empty()) ++seen;
    }
  }
  EXPECT_GE(seen, 15u);
  const MessageRow& sync = *find_message(Message::kSync, true);
  const std::vector<Choice> modes = choices_of(sync.fields[1]);
  ASSERT_EQ(modes.size(), 2u);
  EXPECT_EQ(modes[0].label, "real time");
  EXPECT_EQ(modes[1].number, 1u);
  EXPECT_EQ(modes[1].label, "lockstep");
}

// Catches: the lines of a DBC file that programs depend on, by the letter. canmatrix checks the rest
// (tests/peers/test_can_dbc.py).
TEST(CanTexts, TheDbcFileHasTheseLines) {
  Profile profile;
  profile.fd = false;
  const std::vector<BusAxis> axes = {{"servo", 1}, {"7th axis", 2}, {"7th-axis", 3}};
  std::string text = dbc_text("bench \"one\"", profile, axes);
  EXPECT_TRUE(contains(text,
                       "BO_ 97 servo_currents: 8 Bench\n SG_ i_a : 0|16@1- (0.001,0) [-32.767|32.767] "
                       "\"A\" Controller\n"));
  EXPECT_TRUE(contains(text, " SG_ bus_voltage : 16|16@1+ (0.1,0) [0|6553.4] \"V\" Controller\n"));
  EXPECT_TRUE(contains(text, "BO_ 50 _7th_axis_command: 8 Controller\n"));
  EXPECT_TRUE(contains(text, "BO_ 51 node3_command: 8 Controller\n"));
  EXPECT_TRUE(contains(text, "BO_ 8 sync: 5 Bench\n"));
  EXPECT_TRUE(contains(text, "VAL_ 49 mode 0 \"gates off\" 1 \"voltages\" 2 \"zero voltage\" 3 \"duties"));
  EXPECT_TRUE(contains(text, "BA_ \"VFrameFormat\" BO_ 49 0;\n"));
  EXPECT_TRUE(contains(text, "BA_ \"DBName\" \"bench 'one'\";\n"));
  EXPECT_FALSE(contains(text, "SIG_VALTYPE_"));

  profile = Profile{};
  profile.choose_ids(IdSet::kFree, true);
  text = dbc_text("bench", profile, axes);
  EXPECT_TRUE(contains(text, "BO_ 2147876865 servo_sensors: 32 Bench\n"));
  EXPECT_TRUE(contains(text, "SIG_VALTYPE_ 2147876865 i_a : 1;\n"));
  EXPECT_TRUE(contains(text, "BA_ \"VFrameFormat\" BO_ 2147876865 15;\n"));
  EXPECT_TRUE(contains(text,
                       "CM_ SG_ 2147876865 i_a \"measured current of phase a, into the machine; NaN: no "
                       "value\";\n"));
}

// Catches: a duty or a current that a CAN program shows in volts; a bit without a name.
TEST(CanTexts, TheDbcFileHasUnitsForEveryModeAndNamesForBits) {
  Profile profile;
  profile.fd = false;
  const std::vector<BusAxis> axes = {{"servo", 1}};
  const std::vector<BitWord> words = {
      {.signal = "faults", .bits = {{4, "over_current"}, {256, "lease_lost"}}}};
  std::string text = dbc_text("bench", profile, axes, {}, words);
  for (const char* line :
       {" SG_ u_a m1 : 0|16@1- (0.01,0) [-327.67|327.67] \"V\" Bench\n",
        " SG_ duty_mid_a m3 : 0|16@1- (3.051850947599719e-05,0) [-1|1] \"\" Bench\n",
        " SG_ i_a m4 : 0|16@1- (0.001,0) [-32.767|32.767] \"A\" Bench\n",
        " SG_ duty_b m5 : 16|16@1- (3.051850947599719e-05,0) [-1|1] \"\" Bench\n", " SG_ mode M : 48|4@1+",
        "VAL_ 17 faults 4 \"over_current\" 256 \"lease_lost\" ;\n",
        "VAL_ 49 legs_off 1 \"a\" 2 \"b\" 4 \"c\" ;\n",
        "CM_ SG_ 17 faults \"fault word: 4 over_current, 256 lease_lost\";\n"})
    EXPECT_TRUE(contains(text, line)) << line << text;
  profile.fd = true;
  text = dbc_text("bench", profile, axes);
  EXPECT_TRUE(contains(text, " SG_ i_b m4 : 64|32@1- (1,0) [0|0] \"A\" Bench\n")) << text;
  EXPECT_TRUE(contains(text, "SIG_VALTYPE_ 49 duty_a : 1;\n")) << text;
}

// Catches: a cycle time of all axes together, one in seconds, one for a message that is sent on demand, the
// heartbeat of a bench that sends none.
TEST(CanTexts, TheDbcFileHasTheCycleTimesOfRealTime) {
  const Profile profile{};
  const std::vector<BusAxis> axes = {{"a", 1}, {"b", 2}};
  const BusUse use{.axes = 2,
                   .period_s = 125e-6,
                   .sample_every_ticks = 2.0,
                   .state_every_ticks = 80.0,
                   .heartbeat_ms = 100.0};
  std::string text = dbc_text("bench", profile, axes, bus_load(profile, use).messages);
  for (const char* line : {"BA_DEF_ BO_ \"GenMsgCycleTime\" FLOAT", "BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n",
                           "BA_ \"GenMsgCycleTime\" BO_ 8 0.25;\n",       // sync
                           "BA_ \"GenMsgCycleTime\" BO_ 49 0.25;\n",      // command of a
                           "BA_ \"GenMsgCycleTime\" BO_ 98 0.25;\n",      // sensors of b
                           "BA_ \"GenMsgCycleTime\" BO_ 1681 10;\n",      // state of a
                           "BA_ \"GenMsgCycleTime\" BO_ 1938 100;\n"}) {  // heartbeat of b
    EXPECT_TRUE(contains(text, line)) << line << text;
  }
  for (const char* sent_on_demand : {"BO_ 17 ", "BO_ 113 ", "BO_ 1665 ", "BO_ 1713 "})
    EXPECT_FALSE(contains(text, "\"GenMsgCycleTime\" " + std::string(sent_on_demand))) << sent_on_demand;
  EXPECT_FALSE(contains(dbc_text("bench", profile, axes), "GenMsgCycleTime"));
}

// Catches: lines of the Markdown table that changed unseen.
TEST(CanTexts, TheTableHasTheseLines) {
  Profile profile;
  profile.fd = false;
  const std::string text = table_text("bench", profile, std::vector<BusAxis>{{"servo", 1}, {"load", 9}});
  EXPECT_TRUE(contains(text, "| command | controller | 0x031 | 0x039 |\n"));
  EXPECT_TRUE(contains(text, "| 2-3 | i_b | int16 x 0.001 | A | -32.767 to 32.767 | 0x8000 | measured"));
  EXPECT_TRUE(contains(text, "| currents | `061#DC0512FDE8032301` | i_a 1.5 A, i_b -0.75 A, tick 1000, "));
}

}  // namespace
}  // namespace drivebench::can::can_texts_test
