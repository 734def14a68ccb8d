#include "clients/command/bench/watch.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/signals.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/mode_name.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

/// The default signals: those of the terminals that the machine has.
std::vector<std::string> usual_signals(const v1::AxisDescription& axis) {
  std::vector<std::string> names = {"tick", "state", "faults", "injected", "encoder_count", "i_a_a"};
  if (axis.phases() >= 2) names.emplace_back("i_b_a");
  if (axis.phases() >= 3) names.emplace_back("i_c_a");
  names.emplace_back("u_a_v");
  if (axis.phases() >= 2) names.emplace_back("u_b_v");
  if (axis.phases() >= 3) names.emplace_back("u_c_v");
  if (axis.field_winding()) names.insert(names.end(), {"i_f_a", "u_f_v"});
  names.insert(names.end(), {"angle_rad", "speed_rad_s"});
  return names;
}

std::string value_text(const Signal& signal, const Sample& sample, const v1::BenchDescription& bench) {
  if (signal.name == "state") return name_of_state(sample.state);
  if (signal.name == "faults") return fault_names(bench, sample.faults);
  if (signal.name == "injected") return injected_names(bench, sample.injected);
  return shown_value(signal, sample);
}

/// `i_a_a [A]`; a plain number has no unit.
std::string heading(const Signal& signal) {
  const bool plain_number = signal.unit == "1" || signal.unit == "enum" || signal.unit == "bits";
  return plain_number ? std::string(signal.name) : fmt::format("{} [{}]", signal.name, signal.unit);
}

/// Shows samples one after the other: as lines of text or of JSON, or in a terminal as a block that is drawn
/// again and again.
class View {
 public:
  enum class Form { kLines, kJson, kBlock };

  View(Form form, const v1::BenchDescription& bench, std::uint32_t axis, const WatchOptions& options)
      : form_(form),
        bench_(bench),
        axis_(axis),
        signals_(signals_named(options.signals.empty() ? usual_signals(description()) : options.signals)),
        has_time_(options.signals.empty()) {
    if (form_ == Form::kLines) fmt::print(stderr, "watch: {}\n", title());
  }

  const std::vector<const Signal*>& signals() const noexcept { return signals_; }

  void show(const Sample& sample, std::uint64_t dropped) {
    switch (form_) {
      case Form::kJson:
        fmt::print("{}\n", sample_json(sample, bench_, axis_, dropped, signals_));
        break;
      case Form::kLines:
        show_line(sample);
        break;
      case Form::kBlock:
        show_block(sample);
        break;
    }
    if (form_ != Form::kJson && dropped != 0) note(fmt::format("too slow, {} samples lost", dropped));
    std::fflush(stdout);
    is_started_ = true;
  }

  /// A word about the samples, for people; in a block it stands until the next sample.
  void note(const std::string& text) {
    if (form_ == Form::kBlock) {
      fmt::print("\x1b[1A{}\x1b[K\n", text);
      std::fflush(stdout);
    } else {
      fmt::print(stderr, "watch: {}\n", text);
    }
  }

 private:
  const v1::AxisDescription& description() const { return bench_.axes(static_cast<int>(axis_)); }
  std::string title() const {
    return fmt::format("axis {} ({}) of bench {}, {}", axis_, description().name(), bench_.name(),
                       link::name_of(bench_.mode()));
  }
  std::string time_text(const Sample& sample) const {
    return fmt::format("{:.6f}", static_cast<double>(sample.tick) * bench_.period_s());
  }

  void show_block(const Sample& sample) const {
    if (is_started_) fmt::print("\x1b[{}A", signals_.size() + 2);
    fmt::print("{}: tick {}, {} s\x1b[K\n", title(), sample.tick, time_text(sample));
    for (const Signal* signal : signals_) {
      fmt::print("{:<24}{:>16}\x1b[K\n", heading(*signal), value_text(*signal, sample, bench_));
    }
    fmt::print("\x1b[K\n");  // the place of a note
  }

  void show_line(const Sample& sample) const {
    std::string heads;
    std::string values;
    const auto add = [&](const std::string& head, const std::string& value) {
      heads += fmt::format("  {:>12}", head);
      values += fmt::format("  {:>{}}", value, std::max<std::size_t>(head.size(), 12));
    };
    for (const Signal* signal : signals_) {
      add(heading(*signal), value_text(*signal, sample, bench_));
      if (has_time_ && signal->name == "tick") add("time_s", time_text(sample));
    }
    if (!is_started_) fmt::print("{}\n", heads);
    fmt::print("{}\n", values);
  }

  Form form_;
  const v1::BenchDescription& bench_;
  std::uint32_t axis_;
  std::vector<const Signal*> signals_;
  bool has_time_;  // the signals are the usual ones, so that a column of time fits
  bool is_started_ = false;
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
         "example; "
         "the values go on then";
}

bool is_driven(const v1::Status& status) {
  return std::ranges::any_of(status.axes(), [](const auto& each) { return each.sample().owner() != 0; });
}

}  // namespace

std::string shown_value(const Signal& signal, const Sample& sample) {
  if (signal.type != SignalType::kReal) return fmt::format("{:.0f}", value_of(signal, sample));
  const double value = sample.*signal.as_real;
  const double usual = std::max(std::abs(signal.minimum), std::abs(signal.maximum));
  return fmt::format("{:.6g}", std::abs(value) < 1e-11 * usual ? 0.0 : value);
}

int run_watch(const WatchOptions& options) {
  signals_named(options.signals);  // reports a wrong name before it looks for a bench
  link::Link bench_link = open_link(options.link, "watch");
  const v1::BenchDescription& bench = bench_link.welcome().bench();
  const std::uint32_t axis = axis_number(bench, options.axis);
  const double ticks = std::clamp(std::round(1.0 / (options.rate_hz * bench.period_s())), 1.0, 4e9);
  const bool is_terminal = ::isatty(STDOUT_FILENO) != 0;
  catch_interrupts();
  View view(options.json  ? View::Form::kJson
            : is_terminal ? View::Form::kBlock
                          : View::Form::kLines,
            bench, axis, options);
  // Subscribed first, so that no sample is lost between the present one and those that follow.
  bench_link.subscribe(axis, static_cast<std::uint32_t>(ticks), names_of(view.signals()));
  const v1::Status& status = bench_link.status();
  const Sample present = plain(status.axes(static_cast<int>(axis)).sample());
  view.show(present, 0);
  if (options.count == 1) return kExitOk;
  // Reports a lockstep without a controller at once, any other silence after a second.
  auto patience = bench.mode() == v1::MODE_LOCKSTEP && !is_driven(status) ? 0ms : 1000ms;
  bool is_silent = false;
  for (std::uint64_t shown = 1; !interrupted();) {
    const std::optional<v1::Samples> samples = bench_link.next_samples(patience);
    patience = 1000ms;
    if (!samples) {
      if (!is_silent && !interrupted()) view.note(silence_text(bench.mode()));
      is_silent = true;
      continue;
    }
    is_silent = false;
    std::uint64_t dropped = samples->dropped();
    for (const v1::Sample& sample : samples->samples()) {
      if (sample.tick() <= present.tick) continue;
      view.show(plain(sample), dropped);
      dropped = 0;
      if (++shown == options.count) return kExitOk;
    }
  }
  return kExitOk;
}

}  // namespace drivebench::command
