#pragma once

#include <string>

#include "server/bench/bench.hpp"
#include "server/config/config.hpp"
#include "server/engine/engine.hpp"
#include "tests/server/parameter_row.hpp"

namespace drivebench {

/// A bench of configs/benches with its events, run as the server runs it.
class BookBench {
 public:
  explicit BookBench(const std::string& name)
      : BookBench(load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + name + ".toml")) {}
  explicit BookBench(const BenchConfig& config) : config_(config), bench_(config.setup) {
    schedule_events(config_, bench_);
  }

  Bench& bench() { return bench_; }
  const BenchConfig& config() const { return config_; }
  double period_s() const { return static_cast<double>(config_.setup.period_ns) * 1e-9; }
  double now_s() const { return static_cast<double>(bench_.tick()) * period_s(); }
  const Sample& sample(std::size_t axis = 0) const { return bench_.sample(axis); }

  /// Runs until this time and shows every sample of axis 0 to the visitor.
  template <class Visitor>
  void run_until(double time_s, Visitor visit) {
    while (now_s() < time_s - 0.5 * period_s()) {
      bench_.step();
      visit(sample());
    }
  }
  void run_until(double time_s) {
    run_until(time_s, [](const Sample&) {});
  }

  /// Takes an axis and gives it a command for the present tick.
  void command(std::uint32_t axis, const PhaseCommand& phases) {
    constexpr Owner kController = 1;
    const Tick now = bench_.tick();
    bench_.submit({.tick = now, .axis = axis, .owner = kController, .action = LeaseAction::kAcquire});
    bench_.submit({.tick = now,
                   .axis = axis,
                   .owner = kController,
                   .action = Command{.answers = now, .phases = phases}});
  }

  /// Commands axis 0 at every tick until the time.
  template <class Controller>
  void control_until(double time_s, Controller command_of) {
    while (now_s() < time_s - 0.5 * period_s()) {
      command(0, command_of(sample()));
      bench_.step();
    }
  }

 private:
  BenchConfig config_;
  Bench bench_;
};

/// Mean, least and largest value of a signal.
struct Spread {
  double sum = 0.0;
  double least = 1e300;
  double largest = -1e300;
  int count = 0;

  void add(double x) {
    sum += x;
    least = x < least ? x : least;
    largest = x > largest ? x : largest;
    ++count;
  }
  double mean() const { return sum / count; }
};

}  // namespace drivebench
