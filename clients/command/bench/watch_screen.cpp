#include "clients/command/bench/watch_screen.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include "clients/command/bench/watch_text.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"
#include "protocols/text.hpp"

namespace drivebench::command {
namespace {

constexpr std::size_t kKept = 200;        // values of a curve
constexpr std::size_t kWidestCurve = 60;  // columns
constexpr std::size_t kWidestName = 24;
constexpr std::size_t kNarrowestName = 8;
constexpr std::size_t kValueWidth = 18;
constexpr std::size_t kBesideCurve = kWidestName + kValueWidth + 4;  // and the mark and spaces
constexpr std::size_t kNarrowestCurve = 8;
constexpr std::size_t kFewestRows = 3;  // of values, beside a note and the keys

constexpr std::string_view kValueKeys = "up, down: mark; space: leave out; tab: all signals; q: end";
constexpr std::string_view kListKeys = "up, down: mark; space: show or leave out; tab: values; q: end";

/// The part of `count` rows that fits, with the marked one in it.
std::pair<std::size_t, std::size_t> window_of(std::size_t count, std::size_t fits, std::size_t mark) {
  if (count <= fits) return {0, count};
  const std::size_t first = std::min(mark > fits / 2 ? mark - fits / 2 : 0, count - fits);
  return {first, first + fits};
}

/// The characters of a UTF-8 text.
std::size_t width_of(std::string_view text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char each) { return (each & '\xc0') != '\x80'; }));
}

/// At most so many characters of a UTF-8 text.
std::string cut(std::string_view text, std::size_t most) {
  std::size_t size = text.size();
  while (width_of(text.substr(0, size)) > most)
    --size;
  return std::string(text.substr(0, size));
}

/// An ASCII text as lines that fit.
std::vector<std::string> wrapped(std::string_view text, std::size_t columns) {
  std::vector<std::string> lines;
  while (text.size() > columns) {
    const std::size_t blank = text.rfind(' ', columns);
    const std::size_t size = blank == std::string_view::npos || blank == 0 ? columns : blank;
    lines.emplace_back(text.substr(0, size));
    text.remove_prefix(size == columns && blank != columns ? size : size + 1);
  }
  lines.emplace_back(text);
  return lines;
}

}  // namespace

std::string watch_title(const v1::BenchDescription& bench, std::uint32_t axis) {
  return fmt::format("axis {} ({}) of bench {}, {}", axis,
                     printable(bench.axes(static_cast<int>(axis)).name()), printable(bench.name()),
                     link::name_of(bench.mode()));
}

std::string watched_text(const Signal& signal, const Sample& sample, const v1::BenchDescription& bench) {
  if (signal.name == "state") return name_of_state(sample.state);
  if (signal.name == "faults") return fault_names(bench, sample.faults);
  if (signal.name == "injected") return injected_names(bench, sample.injected);
  return shown_value(signal, sample);
}

void WatchScreen::take(const Sample& sample) {
  show(sample);
  note_.clear();
  for (const Signal* signal : signals_) {
    if (!has_curve(*signal)) continue;
    std::vector<double>& values = curves_[signal];
    if (values.size() == kKept) values.erase(values.begin());
    values.push_back(value_of(*signal, sample));
  }
}

void WatchScreen::show(const Sample& present) {
  sample_ = present;
  unseen_.clear();
}

bool WatchScreen::press(Key key) {
  const std::size_t count = is_list_ ? kSignals.size() : signals_.size();
  switch (key) {
    case Key::kUp:
      mark_ -= mark_ > 0 ? 1 : 0;
      break;
    case Key::kDown:
      mark_ += mark_ + 1 < count ? 1 : 0;
      break;
    case Key::kList:
      is_list_ = !is_list_;
      mark_ = 0;
      break;
    case Key::kToggle:
      if (count > 0) return toggle(is_list_ ? kSignals[mark_] : *signals_[mark_]);
      break;
    case Key::kQuit:
      break;
  }
  return false;
}

bool WatchScreen::toggle(const Signal& signal) {
  const auto row = std::ranges::find(signals_, &signal);
  curves_.erase(&signal);  // of another time
  if (row == signals_.end()) {
    signals_.push_back(&signal);
    unseen_.insert(&signal);
  } else {
    signals_.erase(row);
    if (!is_list_) mark_ = std::min(mark_, signals_.empty() ? 0 : signals_.size() - 1);
  }
  return true;
}

std::vector<std::string> WatchScreen::value_lines(TerminalSize size, bool has_keys) const {
  const std::size_t room = size.columns > kBesideCurve ? size.columns - kBesideCurve : 0;
  const std::size_t width = room < kNarrowestCurve ? 0 : std::min(room, kWidestCurve);
  const auto [first, end] = window_of(signals_.size(), size.rows, mark_);
  std::vector<std::string> values;
  std::size_t widest = 0;
  for (std::size_t row = first; row < end; ++row) {
    values.push_back(value_text(*signals_[row]));
    widest = std::max(widest, width_of(values.back()) + 1);
  }
  // A narrow terminal has no columns to spare between names and values, and less of the names.
  const std::size_t marks = has_keys ? 2 : 0;
  const bool is_narrow = size.columns < marks + kWidestName + kValueWidth;
  const std::size_t value_width = is_narrow ? widest : kValueWidth;
  const std::size_t beside = marks + value_width;
  const std::size_t name_width =
      std::clamp(size.columns > beside ? size.columns - beside : 0, kNarrowestName, kWidestName);
  std::vector<std::string> lines;
  for (std::size_t row = first; row < end; ++row) {
    const Signal& signal = *signals_[row];
    const std::string& value = values[row - first];
    const std::size_t columns = width_of(value);
    const std::string space(columns < value_width ? value_width - columns : 1, ' ');
    const auto curve = curves_.find(&signal);
    const std::string drawn = curve == curves_.end() ? "" : sparkline(curve->second, width, utf8_);
    const char* const mark = !has_keys ? "" : row == mark_ ? "> " : "  ";
    const std::string line =
        fmt::format("{}{:<{}}{}{}", mark, cut(signal.name, name_width), name_width, space, value);
    lines.push_back(drawn.empty() ? cut(line, size.columns) : line + "  " + drawn);
  }
  return lines;
}

std::string WatchScreen::value_text(const Signal& signal) const {
  if (unseen_.contains(&signal)) return utf8_ ? "–" : "-";
  const bool is_word = signal.name == "state" || signal.name == "faults" || signal.name == "injected";
  return is_word ? watched_text(signal, sample_, bench_) : value_with_unit(signal, sample_, utf8_);
}

/// The note and the keys; where that would leave too few rows for the values, the note alone.
std::vector<std::string> WatchScreen::last_lines(TerminalSize size, bool has_keys) const {
  std::vector<std::string> keys;
  if (has_keys || note_.empty())
    keys = wrapped(!has_keys ? "" : is_list_ ? kListKeys : kValueKeys, size.columns);
  if (note_.empty()) return keys;
  std::vector<std::string> lines = wrapped(note_, size.columns);
  const std::size_t rows = is_list_ ? kSignals.size() : signals_.size();
  if (lines.size() + keys.size() + std::min(rows, kFewestRows) <= size.rows)
    std::ranges::move(keys, std::back_inserter(lines));
  return lines;
}

std::vector<std::string> WatchScreen::list_lines(TerminalSize size) const {
  const auto [first, end] = window_of(kSignals.size(), size.rows, mark_);
  std::vector<std::string> lines;
  for (std::size_t row = first; row < end; ++row) {
    const Signal& signal = kSignals[row];
    const bool is_shown = std::ranges::find(signals_, &signal) != signals_.end();
    lines.emplace_back(cut(fmt::format("{}[{}] {:<24} {:<8} {}", row == mark_ ? "> " : "  ",
                                       is_shown ? 'x' : ' ', signal.name, signal.unit, signal.meaning),
                           size.columns));
  }
  return lines;
}

std::string WatchScreen::draw(TerminalSize size, bool has_keys) {
  const std::size_t columns =
      std::max<std::size_t>(size.columns, 2) - 1;  // the last one would break the line
  // Without the title, and the line where the terminal writes on.
  const std::size_t below = size.rows > 2 ? size.rows - 2 : 1;
  const std::vector<std::string> last = last_lines({.columns = columns, .rows = below}, has_keys);
  const TerminalSize room = {.columns = columns, .rows = below > last.size() ? below - last.size() : 1};
  std::vector<std::string> lines = {
      cut(fmt::format("{}: tick {}, {:.6f} s", watch_title(bench_, axis_), sample_.tick,
                      static_cast<double>(sample_.tick) * bench_.period_s()),
          columns)};
  std::ranges::copy(is_list_ ? list_lines(room) : value_lines(room, has_keys), std::back_inserter(lines));
  std::ranges::copy(last, std::back_inserter(lines));

  std::string block = drawn_lines_ > 0 ? fmt::format("\x1b[{}A", drawn_lines_) : std::string();
  for (const std::string& line : lines)
    fmt::format_to(std::back_inserter(block), "{}\x1b[K\n", line);
  if (drawn_lines_ > lines.size()) block += "\x1b[J";  // lines of a longer block
  drawn_lines_ = lines.size();
  return block;
}

}  // namespace drivebench::command
