#include "clients/command/bench/watch.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/bench/watch_screen.hpp"
#include "clients/command/bench/watch_text.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/signals.hpp"
#include "clients/command/common/session/session.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

constexpr auto kSilence = 1000ms;  // of the bench, that is told: so long, and two samples
constexpr auto kKeyTime = 50ms;    // until a key acts
constexpr auto kBlockTime = 30ms;  // between two blocks, however fast the bench runs

constexpr double kUsualRate_hz = 10.0;       // samples per second of the bench's time
constexpr double kLockstepRate_hz = 1000.0;  // where a move of 0.1 s is a whole run

/// The default signals beside the time: those of the terminals that the machine has.
std::vector<std::string> usual_signals(const v1::AxisDescription& axis) {
  std::vector<std::string> names = {"state", "faults", "injected", "encoder_count", "i_a_a"};
  if (axis.phases() >= 2) names.emplace_back("i_b_a");
  if (axis.phases() >= 3) names.emplace_back("i_c_a");
  names.emplace_back("u_a_v");
  if (axis.phases() >= 2) names.emplace_back("u_b_v");
  if (axis.phases() >= 3) names.emplace_back("u_c_v");
  if (axis.field_winding()) names.insert(names.end(), {"i_f_a", "u_f_v"});
  names.insert(names.end(), {"angle_rad", "speed_rad_s"});
  return names;
}

/// The signals to show behind tick and time, which every form of the view has anyway.
std::vector<const Signal*> watched_signals(const WatchOptions& options, const v1::AxisDescription& axis) {
  if (options.signals.empty()) return signals_named(usual_signals(axis));
  return signals_named(without_time(options.signals));
}

/// `i_a_a [A]`; a plain number has no unit.
std::string heading(const Signal& signal) {
  const bool plain_number = signal.unit == "1" || signal.unit == "enum" || signal.unit == "bits";
  return plain_number ? std::string(signal.name) : fmt::format("{} [{}]", signal.name, signal.unit);
}

/// Shows samples one after the other: as lines of text or of JSON, or in a terminal as a block that is drawn
/// again and again and that obeys keys.
class View {
 public:
  enum class Form { kLines, kJson, kBlock };

  View(Form form, const v1::BenchDescription& bench, std::uint32_t axis, const WatchOptions& options)
      : form_(form),
        bench_(bench),
        axis_(axis),
        screen_(bench, axis, watched_signals(options, bench.axes(static_cast<int>(axis))), speaks_utf8()) {
    if (form_ == Form::kLines) fmt::print(stderr, "watch: {}\n", watch_title(bench_, axis_));
    if (form_ == Form::kBlock) keyboard_.emplace();
  }

  const std::vector<const Signal*>& signals() const noexcept { return screen_.signals(); }
  bool has_keys() const noexcept { return keyboard_ && keyboard_->is_there(); }

  void show(const Sample& sample, std::uint64_t dropped) {
    switch (form_) {
      case Form::kJson:
        fmt::print("{}\n", sample_json(sample, bench_, axis_, dropped, signals()));
        break;
      case Form::kLines:
        show_line(sample);
        break;
      case Form::kBlock:
        screen_.take(sample);
        has_news_ = true;
        if (std::chrono::steady_clock::now() >= next_draw_) draw_news();
        break;
    }
    if (form_ != Form::kJson && dropped != 0) note(fmt::format("too slow, {} samples lost", dropped));
    std::fflush(stdout);
    is_started_ = true;
  }

  /// The present values of other signals, which a block shows before the next sample.
  void show_present(const Sample& present) {
    screen_.show(present);
    draw();
  }

  /// Draws the newest sample if it was too soon for it before.
  void draw_news() {
    if (has_news_) draw();
  }

  /// A word about the samples, for people; in a block it stands until the next sample.
  void note(const std::string& text) {
    if (form_ == Form::kBlock) {
      screen_.note(text);
      draw();
    } else {
      fmt::print(stderr, "watch: {}\n", text);
    }
  }

  /// What the keys did since the last call.
  struct Pressed {
    bool ends = false;
    bool has_other_signals = false;
  };
  Pressed obey_keys() {
    Pressed pressed;
    if (!has_keys()) return pressed;
    const std::vector<Key> keys = keyboard_->read();
    for (const Key key : keys) {
      pressed.ends = pressed.ends || key == Key::kQuit;
      pressed.has_other_signals = screen_.press(key) || pressed.has_other_signals;
    }
    if (!keys.empty()) draw();
    return pressed;
  }

 private:
  void draw() {
    has_news_ = false;
    next_draw_ = std::chrono::steady_clock::now() + kBlockTime;
    fmt::print("{}", screen_.draw(terminal_size(), has_keys()));
    std::fflush(stdout);
  }

  void show_line(const Sample& sample) const {
    std::string heads;
    std::string values;
    const auto add = [&](const std::string& head, const std::string& value) {
      heads += fmt::format("  {:>12}", head);
      values += fmt::format("  {:>{}}", value, std::max<std::size_t>(head.size(), 12));
    };
    add("tick", fmt::format("{}", sample.tick));
    add("time_s", fmt::format("{:.6f}", static_cast<double>(sample.tick) * bench_.period_s()));
    for (const Signal* signal : signals())
      add(heading(*signal), watched_text(*signal, sample, bench_));
    if (!is_started_) fmt::print("{}\n", heads);
    fmt::print("{}\n", values);
  }

  Form form_;
  const v1::BenchDescription& bench_;
  std::uint32_t axis_;
  WatchScreen screen_;
  std::optional<Keyboard> keyboard_{};  // of a block
  bool is_started_ = false;
  bool has_news_ = false;  // a sample that the block does not show yet
  std::chrono::steady_clock::time_point next_draw_{};
};

/// The signals of the view and the tick, each once.
std::vector<std::string> names_of(const std::vector<const Signal*>& signals) {
  std::vector<std::string> names = {"tick"};
  for (const Signal* signal : signals)
    names.emplace_back(signal->name);
  std::ranges::sort(names);
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

std::string silence_text(v1::Mode mode) {
  if (mode != v1::MODE_LOCKSTEP) return "the bench sends no samples; waiting";
  return "in lockstep time stands still until a controller drives the bench, `drivebench control` for "
         "example; the values go on then";
}

/// How long a bench may be silent that owes a sample every so many seconds.
std::chrono::milliseconds patience_for(double sample_s) {
  constexpr double kDay = 86400.0;
  return std::max<std::chrono::milliseconds>(
      kSilence, std::chrono::ceil<std::chrono::milliseconds>(
                    std::chrono::duration<double>(std::min(2.0 * sample_s, kDay))));
}

bool is_driven(const v1::Status& status) {
  return std::ranges::any_of(status.axes(), [](const auto& each) { return each.sample().owner() != 0; });
}

}  // namespace

int run_watch(const WatchOptions& options) {
  signals_named(without_time(options.signals));  // reports a wrong name before it looks for a bench
  link::Link bench_link = open_link(options.link, "watch");
  const v1::BenchDescription& bench = bench_link.welcome().bench();
  const std::uint32_t axis = axis_number(bench, options.axis);
  const double rate_hz =
      options.rate_hz.value_or(bench.mode() == v1::MODE_LOCKSTEP ? kLockstepRate_hz : kUsualRate_hz);
  const double ticks = std::clamp(std::round(1.0 / (rate_hz * bench.period_s())), 1.0, 4e9);
  const bool is_terminal = ::isatty(STDOUT_FILENO) != 0;
  catch_interrupts();
  View view(options.json  ? View::Form::kJson
            : is_terminal ? View::Form::kBlock
                          : View::Form::kLines,
            bench, axis, options);
  // Subscribed first, so that no sample is lost between the present one and those that follow.
  const auto subscribe = [&] {
    bench_link.subscribe(axis, static_cast<std::uint32_t>(ticks), names_of(view.signals()));
  };
  subscribe();
  const v1::Status& status = bench_link.status();
  Sample present = plain(status.axes(static_cast<int>(axis)).sample());
  view.show(present, 0);
  if (options.count == 1) return kExitOk;
  // Reports a lockstep without a controller at once, any other silence after a second.
  const std::chrono::milliseconds silence = patience_for(ticks * bench.period_s());
  auto patience = bench.mode() == v1::MODE_LOCKSTEP && !is_driven(status) ? 0ms : silence;
  auto heard = std::chrono::steady_clock::now();
  bool is_silent = false;
  for (std::uint64_t shown = 1; !interrupted();) {
    const View::Pressed pressed = view.obey_keys();
    if (pressed.ends) return kExitOk;
    if (pressed.has_other_signals) {
      subscribe();
      // Samples up to this one may be those of the signals before, and are left out.
      present = plain(bench_link.status().axes(static_cast<int>(axis)).sample());
      view.show_present(present);
    }
    const std::optional<v1::Samples> samples =
        bench_link.next_samples(view.has_keys() ? std::min(patience, kKeyTime) : patience);
    if (!samples) {
      view.draw_news();
      const bool is_over = std::chrono::steady_clock::now() - heard >= patience;
      if (is_over && !is_silent && !interrupted()) view.note(silence_text(bench.mode()));
      if (is_over) {
        is_silent = true;
        patience = silence;
      }
      continue;
    }
    patience = silence;
    heard = std::chrono::steady_clock::now();
    is_silent = false;
    std::uint64_t dropped = samples->dropped();
    for (const v1::Sample& sample : samples->samples()) {
      if (sample.tick() <= present.tick) continue;
      view.show(plain(sample), dropped);
      dropped = 0;
      if (++shown != options.count) continue;
      view.draw_news();
      return kExitOk;
    }
  }
  return kExitOk;
}

}  // namespace drivebench::command
