#include "clients/command/bench/watch_screen.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "clients/command/bench/watch_text.hpp"

namespace drivebench::command::watch_screen_test {
namespace {

std::string with_unit(std::string_view name, const Sample& sample, bool utf8 = true) {
  return value_with_unit(*find_signal(name), sample, utf8);
}

// Catches: a prefix of the neighbour decade, four digits and a half where rounding makes the next prefix,
// prefixes of radians, a unit for words, noise of a model at rest in nanoamperes.
TEST(Watch, ShowsAValueWithItsUnitAndAPrefix) {
  EXPECT_EQ(with_unit("i_a_a", {.i_a_a = -0.00123456}), "-1.2346 mA");
  EXPECT_EQ(with_unit("i_a_a", {.i_a_a = 0.99999999}), "1 A");
  EXPECT_EQ(with_unit("i_a_a", {.i_a_a = 4.5e-5}), "45 µA");
  EXPECT_EQ(with_unit("i_a_a", {.i_a_a = 4.5e-5}, false), "45 uA");
  EXPECT_EQ(with_unit("u_a_v", {.u_a_v = 12345.6}), "12.346 kV");
  EXPECT_EQ(with_unit("u_a_v", {}), "0 V");
  EXPECT_EQ(with_unit("i_a_a", {.i_a_a = -2.2e-16}), "0 A");
  EXPECT_EQ(with_unit("speed_rad_s", {.speed_rad_s = 1234.5}), "1234.5 rad/s");
  EXPECT_EQ(with_unit("encoder_count", {.encoder_count = -12345}), "-12345 counts");
  EXPECT_EQ(with_unit("faults", {.faults = 512}), "512");
}

// Catches: a curve upside down, one that shows the oldest values, a flat one at the top, division by a range
// of 0.
TEST(Watch, DrawsTheNewestValuesFromTheLeastToTheGreatest) {
  const std::array<double, 5> rising = {100.0, 0.0, 1.0, 2.0, 8.0};
  EXPECT_EQ(sparkline(rising, 4, false), "_.:#");
  EXPECT_EQ(sparkline(rising, 4, true), "▁▂▃█");
  EXPECT_EQ(sparkline(std::array<double, 3>{5.0, 5.0, 5.0}, 8, false), "___");
  EXPECT_EQ(sparkline(std::array<double, 1>{5.0}, 8, false), "");
  EXPECT_EQ(sparkline(rising, 0, false), "");
}

// Catches: a height computed from a value that is no number, one infinite value that flattens the others.
TEST(Watch, LeavesOutWhatIsNoNumber) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  const std::array<double, 5> values = {0.0, kInfinite, 1.0, std::nan(""), -kInfinite};
  EXPECT_EQ(sparkline(values, 5, false), "_ #  ");
  EXPECT_EQ(sparkline(std::array<double, 2>{kInfinite, kInfinite}, 5, false), "  ");
}

// Catches: a sequence that two reads split, letters of an unknown sequence that act as keys.
TEST(Watch, TakesKeysAlsoFromPiecesOfSequences) {
  std::string bytes = "\x1b";
  EXPECT_TRUE(take_keys(bytes).empty());
  bytes += "[";
  EXPECT_TRUE(take_keys(bytes).empty());
  bytes += "A\x1b[B \tq\x1b[1;5qz";
  EXPECT_EQ(take_keys(bytes), (std::vector<Key>{Key::kUp, Key::kDown, Key::kToggle, Key::kList, Key::kQuit}));
  EXPECT_TRUE(bytes.empty());
}

v1::BenchDescription bench() {
  v1::BenchDescription description;
  description.set_name("b");
  description.set_mode(v1::MODE_FREE);
  description.set_period_s(0.001);
  description.add_axes()->set_name("x");
  return description;
}

std::size_t lines_of(const std::string& block) {
  return static_cast<std::size_t>(std::ranges::count(block, '\n'));
}

/// Whether a line of the block begins and ends so.
bool has_line(const std::string& block, const std::string& begin, const std::string& end) {
  std::istringstream lines(block);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(begin) && line.ends_with(end + "\x1b[K")) return true;
  }
  return false;
}

/// Chooses a signal from the list of all.
void choose(WatchScreen& screen, std::string_view name) {
  screen.press(Key::kList);
  for (std::ptrdiff_t row = find_signal(name) - kSignals.data(); row > 0; --row)
    screen.press(Key::kDown);
  screen.press(Key::kToggle);
  screen.press(Key::kList);
}

// Catches: a mark that leaves the list, a signal that comes twice, a curve that goes on from another time,
// lines of the longer block that stay.
TEST(Watch, KeysChooseTheSignals) {
  const v1::BenchDescription description = bench();
  WatchScreen screen(description, 0, {find_signal("i_a_a"), find_signal("u_a_v")}, false);
  screen.take({.tick = 1, .i_a_a = 1.0});
  screen.take({.tick = 2, .i_a_a = 2.0});
  const std::string first = screen.draw({}, true);
  EXPECT_NE(first.find("> i_a_a" + std::string(34, ' ') + "2 A  _#"), std::string::npos) << first;
  EXPECT_EQ(lines_of(first), 4U);
  EXPECT_FALSE(screen.press(Key::kUp));
  EXPECT_TRUE(screen.press(Key::kToggle));
  const std::string second = screen.draw({}, true);
  EXPECT_TRUE(second.starts_with("\x1b[4A")) << second;
  EXPECT_TRUE(second.ends_with("\x1b[J")) << second;
  EXPECT_EQ(screen.signals(), (std::vector<const Signal*>{find_signal("u_a_v")}));
  EXPECT_FALSE(screen.press(Key::kList));
  for (std::size_t i = 0; i < 2 * kSignals.size(); ++i)
    EXPECT_FALSE(screen.press(Key::kDown));
  EXPECT_TRUE(screen.press(Key::kToggle));  // the last one
  EXPECT_EQ(screen.signals(), (std::vector<const Signal*>{find_signal("u_a_v"), &kSignals.back()}));
  const std::string list = screen.draw({.columns = 30, .rows = 10}, true);
  EXPECT_EQ(lines_of(list), 9U);  // it leaves the last line of the terminal free
  EXPECT_NE(list.find("> [x] " + std::string(kSignals.back().name)), std::string::npos) << list;
}

// Catches: the 0 of a sample without the signal that passes for its value, and begins its curve.
TEST(Watch, ASignalThatWasJustChosenHasNoValueYet) {
  const v1::BenchDescription description = bench();
  WatchScreen screen(description, 0, {find_signal("i_a_a")}, false);
  screen.take({.tick = 1, .i_a_a = 1.0, .u_a_v = 5.0});
  choose(screen, "u_a_v");
  EXPECT_TRUE(has_line(screen.draw({}, true), "  u_a_v", "-"));
  screen.show({.tick = 2, .u_a_v = 5.0});
  EXPECT_TRUE(has_line(screen.draw({}, true), "  u_a_v", "5 V"));
  screen.take({.tick = 3, .u_a_v = 6.0});
  screen.take({.tick = 4, .u_a_v = 7.0});
  EXPECT_TRUE(has_line(screen.draw({}, true), "  u_a_v", "7 V  _#"));
}

// Catches: a note that takes the line of the keys while the bench is silent, or the lines of the values.
TEST(Watch, ANoteStandsAboveTheKeysWhereThereIsRoom) {
  const v1::BenchDescription description = bench();
  WatchScreen screen(description, 0, {find_signal("i_a_a"), find_signal("u_a_v"), find_signal("angle_rad")},
                     false);
  screen.take({.tick = 1});
  screen.note("waiting");
  const std::string roomy = screen.draw({.columns = 80, .rows = 7}, true);
  EXPECT_NE(roomy.find("waiting\x1b[K\nup, down"), std::string::npos) << roomy;
  const std::string low = screen.draw({.columns = 80, .rows = 6}, true);
  EXPECT_NE(low.find("waiting"), std::string::npos) << low;
  EXPECT_EQ(low.find("up, down"), std::string::npos) << low;
}

// Catches: names that fill a narrow terminal and push the values out of it.
TEST(Watch, ANarrowTerminalShowsValues) {
  const v1::BenchDescription description = bench();
  WatchScreen screen(description, 0, {find_signal("encoder_count"), find_signal("i_a_a")}, true);
  screen.take({.tick = 1, .encoder_count = -1234567, .i_a_a = 4.5e-5});
  const std::string block = screen.draw({.columns = 30, .rows = 10}, true);
  EXPECT_TRUE(has_line(block, "> encoder_", " -1234567 counts")) << block;
  EXPECT_TRUE(has_line(block, "  i_a_a", " 45 µA")) << block;
}

// Catches: a bench whose names move the cursor of the terminal.
TEST(Watch, NamesArePrinted) {
  v1::BenchDescription description = bench();
  description.set_name("b\x1b[2J");
  description.mutable_axes(0)->set_name("x\ny");
  description.add_faults()->set_bit(1);
  description.mutable_faults(0)->set_name("hot\x1b[H");
  EXPECT_EQ(watch_title(description, 0), "axis 0 (x?y) of bench b?[2J, free");
  EXPECT_EQ(watched_text(*find_signal("faults"), {.faults = 1}, description), "hot?[H");
}

// Catches: a block higher than the terminal, which creeps, and a curve that breaks the line.
TEST(Watch, TheBlockFitsIntoTheTerminal) {
  const v1::BenchDescription description = bench();
  std::vector<const Signal*> all;
  for (const Signal& each : kSignals)
    all.push_back(&each);
  WatchScreen screen(description, 0, all, false);
  for (std::uint64_t tick = 0; tick < 500; ++tick)
    screen.take({.tick = tick, .u_a_v = static_cast<double>(tick)});
  const std::string block = screen.draw({.columns = 60, .rows = 12}, true);
  EXPECT_EQ(lines_of(block), 11U);
  std::size_t begin = block.find('\n') + 1;
  for (std::size_t end = block.find("\x1b[K\n", begin); end != std::string::npos;
       end = block.find("\x1b[K\n", begin)) {
    EXPECT_LE(end - begin, 60U) << block.substr(begin, end - begin);
    begin = end + 4;
  }
}

}  // namespace
}  // namespace drivebench::command::watch_screen_test
