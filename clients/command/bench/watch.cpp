#include "clients/command/bench/watch.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "clients/command/bench/bench_json.hpp"
#include "clients/command/common/errors.hpp"
#include "clients/command/common/session.hpp"

namespace drivebench::command {
namespace {

using namespace std::chrono_literals;

/// What is usually looked at: the terminals that the machine has.
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

std::vector<const Signal*> chosen_signals(const std::vector<std::string>& names) {
  std::vector<const Signal*> signals;
  for (const std::string& name : names) {
    const Signal* signal = find_signal(name);
    if (signal == nullptr)
      throw UsageError(fmt::format("no signal '{}'; `drivebench describe` lists them", name));
    signals.push_back(signal);
  }
  return signals;
}

std::string value_text(const Signal& signal, const Sample& sample, const v1::BenchDescription& bench) {
  if (signal.name == "state") return name_of_state(sample.state);
  if (signal.name == "faults") return fault_names(bench, sample.faults);
  if (signal.name == "injected") return injected_names(bench, sample.injected);
  if (signal.type == SignalType::kReal) return fmt::format("{:.6g}", sample.*signal.as_real);
  return fmt::format("{:.0f}", value_of(signal, sample));
}

/// `i_a_a [A]`; a plain number has no unit.
std::string heading(const Signal& signal) {
  const bool plain_number = signal.unit == "1" || signal.unit == "enum" || signal.unit == "bits";
  return plain_number ? std::string(signal.name) : fmt::format("{} [{}]", signal.name, signal.unit);
}

/// One way to show samples.
struct View {
  const std::vector<const Signal*>& signals;
  const v1::BenchDescription& bench;
  std::uint32_t axis;
  bool json;
  bool redraw;
  bool started = false;

  void show(const Sample& sample, std::uint64_t dropped) {
    if (json) {
      fmt::print("{}\n", sample_json(sample, axis, dropped, signals));
    } else if (redraw) {
      show_block(sample);
    } else {
      show_line(sample);
    }
    if (!json && dropped != 0) fmt::print(stderr, "watch: too slow, {} samples lost\n", dropped);
    std::fflush(stdout);
    started = true;
  }

 private:
  void show_block(const Sample& sample) const {
    if (started) fmt::print("\x1b[{}A", signals.size());
    for (const Signal* signal : signals) {
      fmt::print("{:<24}{:>16}\x1b[K\n", heading(*signal), value_text(*signal, sample, bench));
    }
  }

  void show_line(const Sample& sample) const {
    if (!started) {
      for (const Signal* signal : signals)
        fmt::print("  {:>12}", heading(*signal));
      fmt::print("\n");
    }
    for (const Signal* signal : signals)
      fmt::print("  {:>{}}", value_text(*signal, sample, bench),
                 std::max<std::size_t>(heading(*signal).size(), 12));
    fmt::print("\n");
  }
};

}  // namespace

int run_watch(const WatchOptions& options) {
  chosen_signals(options.signals);  // a wrong name is told before a bench is looked for
  link::Link bench_link = open_link(options.link, "watch");
  const v1::BenchDescription& bench = bench_link.welcome().bench();
  const std::uint32_t axis = axis_number(bench, options.axis);
  const std::vector<const Signal*> signals = chosen_signals(
      options.signals.empty() ? usual_signals(bench.axes(static_cast<int>(axis))) : options.signals);
  const double ticks = std::clamp(std::round(1.0 / (options.rate_hz * bench.period_s())), 1.0, 4e9);
  std::vector<std::string> names = {"tick"};
  for (const Signal* signal : signals)
    names.emplace_back(signal->name);
  std::ranges::sort(names);
  names.erase(std::unique(names.begin(), names.end()), names.end());

  catch_interrupts();
  bench_link.subscribe(axis, static_cast<std::uint32_t>(ticks), names);
  View view = {.signals = signals,
               .bench = bench,
               .axis = axis,
               .json = options.json,
               .redraw = ::isatty(STDOUT_FILENO) != 0};
  bool said_waiting = false;
  for (std::uint64_t shown = 0; !interrupted();) {
    const std::optional<v1::Samples> samples = bench_link.next_samples(1s);
    if (!samples) {
      if (!view.started && !said_waiting && !interrupted()) {
        fmt::print(stderr, "watch: waiting for the bench to tick{}\n",
                   bench.mode() == v1::MODE_LOCKSTEP ? " (lockstep: its controller makes it)" : "");
        said_waiting = true;
      }
      continue;
    }
    std::uint64_t dropped = samples->dropped();
    for (const v1::Sample& sample : samples->samples()) {
      view.show(plain(sample), dropped);
      dropped = 0;
      if (++shown == options.count) return kExitOk;
    }
  }
  return kExitOk;
}

}  // namespace drivebench::command
