#include "clients/command/bench/watch_screen.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include "clients/command/bench/watch_text.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"

namespace drivebench::command {
namespace {

constexpr std::size_t kKept = 200;                 // values of a curve
constexpr std::size_t kWidestCurve = 60;           // columns
constexpr std::size_t kBesideCurve = 24 + 18 + 4;  // columns of name, value and spaces
constexpr std::size_t kNarrowestCurve = 8;

constexpr std::string_view kValueKeys = "up, down: mark; space: leave out; tab: all signals; q: end";
constexpr std::string_view kListKeys = "up, down: mark; space: show or leave out; tab: values; q: end";

/// The part of `count` rows that fits, with the marked one in it.
std::pair<std::size_t, std::size_t> window_of(std::size_t count, std::size_t fits, std::size_t mark) {
  if (count <= fits) return {0, count};
  const std::size_t first = std::min(mark > fits / 2 ? mark - fits / 2 : 0, count - fits);
  return {first, first + fits};
}

/// At most so many bytes of an ASCII text.
std::string_view cut(std::string_view text, std::size_t most) {
  return text.substr(0, most);
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
  return fmt::format("axis {} ({}) of bench {}, {}", axis, bench.axes(static_cast<int>(axis)).name(),
                     bench.name(), link::name_of(bench.mode()));
}

std::string watched_text(const Signal& signal, const Sample& sample, const v1::BenchDescription& bench) {
  if (signal.name == "state") return name_of_state(sample.state);
  if (signal.name == "faults") return fault_names(bench, sample.faults);
  if (signal.name == "injected") return injected_names(bench, sample.injected);
  return shown_value(signal, sample);
}

void WatchScreen::take(const Sample& sample) {
  sample_ = sample;
  note_.clear();
  for (const Signal* signal : signals_) {
    if (!has_curve(*signal)) continue;
    std::vector<double>& values = curves_[signal];
    if (values.size() == kKept) values.erase(values.begin());
    values.push_back(value_of(*signal, sample));
  }
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
  std::vector<std::string> lines;
  for (std::size_t row = first; row < end; ++row) {
    const Signal& signal = *signals_[row];
    const bool is_word = signal.name == "state" || signal.name == "faults" || signal.name == "injected";
    const std::string value =
        is_word ? watched_text(signal, sample_, bench_) : value_with_unit(signal, sample_, utf8_);
    // "µ" has two bytes and one column.
    const std::size_t columns = value.size() - static_cast<std::size_t>(std::ranges::count(value, '\xc2'));
    const std::string space(columns < 18 ? 18 - columns : 1, ' ');
    const auto curve = curves_.find(&signal);
    const std::string drawn = curve == curves_.end() ? "" : sparkline(curve->second, width, utf8_);
    const char* const mark = !has_keys ? "" : row == mark_ ? "> " : "  ";
    const std::string line = fmt::format("{}{:<24}{}{}", mark, signal.name, space, value);
    lines.push_back(drawn.empty() ? std::string(cut(line, size.columns)) : line + "  " + drawn);
  }
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
  const std::string_view keys = !has_keys ? "" : is_list_ ? kListKeys : kValueKeys;
  const std::vector<std::string> last = wrapped(note_.empty() ? keys : std::string_view(note_), columns);
  const std::size_t others = last.size() + 2;  // with the title, and the line where the terminal writes on
  const TerminalSize room = {.columns = columns, .rows = size.rows > others ? size.rows - others : 1};
  std::vector<std::string> lines = {
      std::string(cut(fmt::format("{}: tick {}, {:.6f} s", watch_title(bench_, axis_), sample_.tick,
                                  static_cast<double>(sample_.tick) * bench_.period_s()),
                      columns))};
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
