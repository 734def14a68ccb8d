#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <vector>

#include "tests/protocols/can/can_sample.hpp"

namespace drivebench::can::can_match_test {
namespace {

Frame a_frame(Message message, bool fd, std::uint32_t node = 1) {
  return encode(*find_message(message, fd), profile_of(fd), node, Values{});
}

// Catches: a message that is taken for another, or for another node's, at the ends of the ranges.
TEST(CanMatch, EveryMessageOfEveryNodeIsRecognised) {
  for (const bool fd : {false, true}) {
    for (const Profile& profile : every_id_set(fd)) {
      for (const MessageRow& row : kMessages) {
        if (find_message(row.message, fd) != &row) continue;
        for (std::uint32_t node = 1; node <= profile.max_node(); ++node) {
          const Match found = match(profile, encode(row, profile, node, Values{}));
          EXPECT_TRUE(found.ok()) << row.name;
          EXPECT_EQ(found.row, &row) << row.name;
          EXPECT_EQ(found.node, row.per_node ? node : 0);
        }
      }
    }
  }
}

// Catches: identifiers next to ours that are taken for ours; node 0, which no axis has.
TEST(CanMatch, OtherIdentifiersAreForeign) {
  const auto id_frame = [](std::uint32_t id) { return Frame{.id = id, .size = 8}; };
  for (const Profile& profile : every_id_set(false)) {
    if (profile.extended) continue;
    std::size_t ours = 0;
    for (std::uint32_t id = 0; id <= kMaxStandardId; ++id) {
      const Match found = match(profile, id_frame(id));
      EXPECT_EQ(found.row == nullptr, found.problem == FrameProblem::kForeign);
      if (found.row != nullptr) ++ours;
    }
    EXPECT_EQ(ours, 1 + 11 * profile.max_node());
  }
  for (const std::uint32_t id : {0x000u, 0x001u, 0x010u, 0x051u, 0x080u, 0x6A0u, 0x6C1u, 0x790u, 0x7A1u})
    EXPECT_EQ(problem_of(profile_of(false), id_frame(id)), FrameProblem::kForeign) << id;
  for (const std::uint32_t id : {0x000u, 0x07Fu, 0x100u, 0x180u, 0x200u, 0x581u, 0x601u, 0x700u, 0x780u})
    EXPECT_EQ(problem_of(with_ids(IdSet::kCanopen, profile_of(false)), id_frame(id)), FrameProblem::kForeign)
        << id;
}

// Catches: a default identifier that a CANopen device uses, in any kind of frame: NMT, SYNC, TIME, EMCY, the
// process data and SDO of 127 nodes, heartbeats and guarding, LSS, GFC of CiA 304, diagnosis of vehicles.
TEST(CanMatch, CAN_15_NoFrameOfCanopenHasADefaultIdentifier) {
  std::vector<std::uint32_t> theirs = {0x000, 0x001, 0x080, 0x100, 0x7E4, 0x7E5, 0x7DF};
  for (std::uint32_t node = 1; node <= 127; ++node) {
    for (std::uint32_t function = 0x080; function <= 0x600; function += 0x080)
      theirs.push_back(function + node);
    theirs.push_back(0x700 + node);
  }
  for (std::uint32_t id = 0x7E0; id <= 0x7EF; ++id)
    theirs.push_back(id);
  for (const bool fd : {false, true}) {
    const Profile profile = with_wide_axes(profile_of(fd));
    for (const std::uint32_t id : theirs) {
      for (std::uint8_t size = 0; size <= 8; ++size)
        EXPECT_EQ(match(profile, {.id = id, .size = size}).row, nullptr) << id;
    }
  }
}

// Catches: a frame that is executed although its form is wrong (CAN-09), or is counted as something else.
TEST(CanMatch, WrongFormsAreDistinguished) {
  const Profile classic = profile_of(false);
  const Frame good = a_frame(Message::kCommand, false);
  EXPECT_EQ(problem_of(classic, good), FrameProblem::kNone);

  Frame frame = good;
  frame.extended = true;
  EXPECT_EQ(problem_of(classic, frame), FrameProblem::kWrongFormat);
  frame.id |= 0x1555'5000;  // the low bits alone are ours
  EXPECT_EQ(problem_of(classic, frame), FrameProblem::kForeign);

  frame = good;
  frame.remote = true;
  EXPECT_EQ(problem_of(classic, frame), FrameProblem::kRemote);

  frame = good;
  frame.error = true;
  EXPECT_EQ(problem_of(classic, frame), FrameProblem::kError);
  EXPECT_EQ(match(classic, frame).row, nullptr);

  frame = good;
  frame.fd = true;
  EXPECT_EQ(problem_of(classic, frame), FrameProblem::kWrongKind);

  for (std::uint8_t size = 0; size < 8; ++size) {
    frame = good;
    frame.size = size;
    EXPECT_EQ(problem_of(classic, frame), FrameProblem::kWrongSize) << int{size};
  }

  Profile extended = classic;
  extended.choose_ids(IdSet::kCanopen, true);
  EXPECT_EQ(problem_of(extended, encode(*find_message(Message::kCommand, false),
                                        with_ids(IdSet::kCanopen, classic), 1, Values{})),
            FrameProblem::kWrongFormat);
}

// Catches: an FD frame of a length that another message has; a classic frame taken for an FD message; a short
// message refused because it came without FD.
TEST(CanMatch, TheFdProfileTakesShortMessagesInBothKinds) {
  const Profile fd = profile_of(true);
  Frame frame = a_frame(Message::kRequest, true);
  EXPECT_TRUE(frame.fd);
  EXPECT_EQ(problem_of(fd, frame), FrameProblem::kNone);
  frame.fd = frame.bit_rate_switch = false;
  EXPECT_EQ(problem_of(fd, frame), FrameProblem::kNone);
  frame.remote = true;
  EXPECT_EQ(problem_of(fd, frame), FrameProblem::kRemote);

  frame = a_frame(Message::kCommand, true);
  frame.size = 20;
  EXPECT_EQ(problem_of(fd, frame), FrameProblem::kWrongSize);
  EXPECT_EQ(problem_of(fd, a_frame(Message::kCommand, false)), FrameProblem::kWrongKind);
  EXPECT_EQ(problem_of(profile_of(false), a_frame(Message::kCommand, true)), FrameProblem::kWrongKind);
}

// Catches: bytes of no field that are let through, and bytes of fields or edges that are not; a page that
// does not exist.
TEST(CanMatch, BytesOfNoFieldMustBeZero) {
  for (const MessageRow& row : kMessages) {
    const bool fd = row.variant == Variant::kFd;
    for (std::size_t page = 0; page < (is_paged(row) ? kPages + 1 : 1); ++page) {
      for (std::size_t byte = is_paged(row) ? 1 : 0; byte < row.size; ++byte) {
        Frame frame = encode(row, profile_of(fd), 1, Values{});
        if (is_paged(row)) frame.data[0] = static_cast<std::uint8_t>(page);
        frame.data[byte] = 0x80;
        const bool used = std::ranges::any_of(row.fields,
                                              [&](const Field& field) {
                                                return is_on_page(field, page) &&
                                                       byte >= field.start_bit / 8U &&
                                                       byte < (field.start_bit + field.bits) / 8U;
                                              }) ||
                          (row.message == Message::kEdges && byte >= kFirstEdgeByte);
        EXPECT_EQ(problem_of(with_wide_axes(profile_of(fd)), frame),
                  used ? FrameProblem::kNone : FrameProblem::kReserved)
            << row.name << " " << page << " " << byte;
      }
    }
  }
}

TEST(CanMatch, EveryProblemHasAName) {
  for (std::size_t i = 0; i < kFrameProblems; ++i)
    EXPECT_FALSE(name_of(static_cast<FrameProblem>(i)).empty());
  EXPECT_EQ(name_of(FrameProblem::kReserved), "reserved");
}

bool has(const std::vector<ProfileProblem>& found, std::string_view field) {
  return std::ranges::any_of(found, [&](const ProfileProblem& problem) { return problem.field == field; });
}

std::vector<ProfileProblem> with_id(Message message, std::uint32_t id, bool extended = false,
                                    IdSet set = IdSet::kFree) {
  Profile profile = profile_of(true);
  profile.choose_ids(set, extended);
  profile.base_ids[static_cast<std::size_t>(message)] = id;
  return problems(profile);
}

// Catches: identifiers that overlap or do not fit, noticed on the bus only; a refusal of the default profile.
TEST(CanProfile, IdentifiersMustFitAndKeepApart) {
  for (const bool fd : {false, true}) {
    for (const Profile& profile : every_id_set(fd))
      EXPECT_TRUE(problems(profile).empty());
  }
  EXPECT_TRUE(with_id(Message::kHeartbeat, 0x7FF - 15).empty());
  EXPECT_TRUE(has(with_id(Message::kHeartbeat, 0x7FF - 14), "ids.heartbeat"));
  EXPECT_TRUE(with_id(Message::kHeartbeat, 0x7FF - 127, false, IdSet::kCanopen).empty());
  EXPECT_TRUE(has(with_id(Message::kHeartbeat, 0x7FF - 126, false, IdSet::kCanopen), "ids.heartbeat"));
  EXPECT_TRUE(with_id(Message::kSync, 0x7FF).empty()) << "no node is added to it";
  EXPECT_TRUE(has(with_id(Message::kSync, 0x800), "ids.sync"));
  EXPECT_TRUE(has(with_id(Message::kSync, 0x11), "ids.fault"));
  EXPECT_TRUE(has(with_id(Message::kState, 0x680 + 14), "ids.state")) << "the last of reply";
  EXPECT_TRUE(with_id(Message::kEncoder, 0x030).empty()) << "no message of this variant";
  EXPECT_TRUE(with_id(Message::kState, kMaxExtendedId - 127, true).empty());
  EXPECT_TRUE(has(with_id(Message::kState, kMaxExtendedId - 126, true), "ids.state"));
  EXPECT_TRUE(has(with_id(Message::kState, 0xFFFF'FFFF, true), "ids.state"));
}

// Catches: units that no number can be divided by.
TEST(CanProfile, UnitsMustBePositiveNumbers) {
  constexpr auto kUnits = std::to_array<double Profile::*>(
      {&Profile::current_unit_a, &Profile::voltage_unit_v, &Profile::bus_voltage_unit_v,
       &Profile::speed_unit_rad_s, &Profile::edge_time_unit_s});
  for (double Profile::*const unit : kUnits) {
    for (const double bad :
         {0.0, -1e-3, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
      Profile profile;
      profile.*unit = bad;
      EXPECT_EQ(problems(profile).size(), 1u);
    }
  }
}

// Catches: two axes that answer to one node, and nodes that no identifier has room for.
TEST(CanProfile, NodesMustDifferAndBeInRange) {
  Profile profile;
  EXPECT_TRUE(problems(profile, std::to_array<std::uint32_t>({1, 15})).empty());
  EXPECT_EQ(problems(profile, std::to_array<std::uint32_t>({0, 16, 128})).size(), 3u);
  profile.choose_ids(IdSet::kFree, true);
  EXPECT_TRUE(problems(profile, std::to_array<std::uint32_t>({1, 127})).empty());
  EXPECT_EQ(problems(profile, std::to_array<std::uint32_t>({0, 128})).size(), 2u);
  EXPECT_EQ(problems(profile, std::to_array<std::uint32_t>({3, 4, 3})).size(), 1u);
}

// Catches: a step over the end of the number that goes the long way round.
TEST(CanUnwrap, TheNearestNumberIsTaken) {
  static_assert(unwrap(0x01, 8, 0xFF) == 0x101);
  static_assert(unwrap(0xFF, 8, 0x100) == 0xFF);
  static_assert(unwrap(0xFF, 8, 0) == -1);
  static_assert(unwrap(0x80, 8, 0) == -128, "as far up as down: the lower");
  static_assert(unwrap(0x7F, 8, 0) == 127);
  static_assert(unwrap(0xFFFF, 16, -1) == -1);
  static_assert(unwrap(0, 32, 0xFFFF'FFFF) == 0x1'0000'0000);
  static_assert(unwrap(0x1234'5678'9ABC'DEF0, 64, 5) == 0x1234'5678'9ABC'DEF0);
  static_assert(unwrap(0xABC, 8, 0) == -68, "higher bits do not count");
  std::mt19937_64 random(2);
  for (const unsigned bits : {8u, 16u, 32u}) {
    const std::int64_t half = std::int64_t{1} << (bits - 1);
    for (int round = 0; round < 20000; ++round) {
      const auto near = static_cast<std::int64_t>(random()) >> 8;
      const auto away = static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(2 * half)) - half;
      EXPECT_EQ(unwrap(static_cast<std::uint64_t>(near + away), bits, near), near + away);
    }
  }
}

/// Sends what a sample says once a second and follows it, as a client does.
void follow_a_day(bool fd, bool wide = false) {
  constexpr std::uint64_t kTicksPerSecond = 8000;
  constexpr int kSeconds = 24 * 3600;
  std::mt19937_64 random(9);
  Sample sample;
  sample.tick = 0xFFFF'FFFF - std::uint64_t{12} * 3600 * kTicksPerSecond;  // wraps at noon
  sample.encoder_count = 0x7FFF'FFFF - 1'000'000;
  Sample received = sample;
  for (int second = 0; second < kSeconds; ++second) {
    sample.tick += kTicksPerSecond;
    sample.command_tick = static_cast<std::int64_t>(sample.tick) - 1;
    sample.missed_commands += random() % kTicksPerSecond;
    sample.refused_commands += random() % 0x8000;
    sample.late_ticks += random() % 0x80;
    const std::int64_t speed = second < kSeconds / 2 ? 1'000'000 : -2'000'000;  // counts/s
    sample.encoder_count += speed;
    sample.index_count = sample.encoder_count - 7;
    sample.index_tick = sample.command_tick - 5;
    if (second == 0) received.command_tick = received.index_tick = sample.command_tick;
    for (const MessageRow& row : kMessages) {
      if (find_message(row.message, fd, wide) != &row || row.sender != Sender::kBench) continue;
      update_sample(row, decode(row, profile_of(fd), encode_sample(row, profile_of(fd), 1, sample)),
                    received);
    }
    ASSERT_EQ(received.tick, sample.tick) << second;
    ASSERT_EQ(received.command_tick, sample.command_tick) << second;
    ASSERT_EQ(received.missed_commands, sample.missed_commands) << second;
    ASSERT_EQ(received.refused_commands, sample.refused_commands) << second;
    ASSERT_EQ(received.late_ticks, sample.late_ticks) << second;
    ASSERT_EQ(received.encoder_count, sample.encoder_count) << second;
    ASSERT_EQ(received.index_count, sample.index_count) << second;
    ASSERT_EQ(received.index_tick, sample.index_tick) << second;
  }
  EXPECT_GT(sample.tick, 0x1'0000'0000u);
  EXPECT_LT(sample.encoder_count, -0x8000'0000ll);
}

// Catches: counters that a day of frames leads astray: ticks of 16 and 32 bits, counts of 32 bits over both
// ends, counters of 8 and 16 bits.
TEST(CanUnwrap, ADayOfClassicFramesIsFollowed) {
  follow_a_day(false);
}
TEST(CanUnwrap, ADayOfFdFramesIsFollowed) {
  follow_a_day(true);
}
TEST(CanUnwrap, ADayOfAWideAxisIsFollowed) {
  follow_a_day(false, true);
}

// Catches: every tick of 16 bits, three times around, in classic frames.
TEST(CanUnwrap, EveryTickOfSixteenBitsIsFollowed) {
  const MessageRow& row = *find_message(Message::kCurrents, false);
  const Profile profile = profile_of(false);
  Sample sample;
  Sample received;
  for (sample.tick = 0; sample.tick < 200'000; ++sample.tick) {
    update_sample(row, decode(row, profile, encode_sample(row, profile, 1, sample)), received);
    ASSERT_EQ(received.tick, sample.tick);
  }
}

// Catches: a client that comes late and takes the first tick for one before the start.
TEST(CanUnwrap, TheFirstNumberIsNeverNegative) {
  const MessageRow& row = *find_message(Message::kCurrents, false);
  Sample received;
  update_sample(row, Values{0, 0, 0xFFF0}, received);
  EXPECT_EQ(received.tick, 0xFFF0u);
}

}  // namespace
}  // namespace drivebench::can::can_match_test
