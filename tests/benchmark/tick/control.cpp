#include <benchmark/benchmark.h>
#include <fmt/core.h>

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/control/presets/presets.hpp"
#include "server/bench/bench.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/book/measurement_of.hpp"

namespace drivebench::speed::controllers {
namespace {

constexpr std::size_t kRounds = 10;
constexpr double kMostUpdateNs = 250.0;
constexpr double kLeastTimesRealTime = 100.0;
constexpr Owner kController = 1;

/// A preset's run on its own bench, without rows or statistics.
class InProcess {
 public:
  explicit InProcess(const control::Preset& preset)
      : run_(preset.make({})), bench_(bench_config(std::string(preset.bench)).setup) {
    bench_.submit({.tick = 0, .axis = 0, .owner = kController, .action = LeaseAction::kAcquire});
  }

  /// One tick; returns the input of the controller.
  control::Measurement step() {
    const control::Measurement measured = measurement_of(bench_.sample(0));
    const Command command = {.answers = bench_.tick(),
                             .phases = command_of(run_.step(measured), run_.controller().quantity())};
    bench_.submit({.tick = bench_.tick(), .axis = 0, .owner = kController, .action = command});
    bench_.step();
    return measured;
  }

  const control::Run& run() const { return run_; }

 private:
  control::Run run_;
  Bench bench_;
};

/// Median time of a sample of the controller alone, over the inputs of a run.
Row update_of(std::string_view name) {
  const control::Preset& preset = *control::find_preset(name);
  InProcess original(preset);
  std::vector<control::Measurement> seen;
  while (!original.run().done())
    seen.push_back(original.step());

  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] {
    control::Run run = preset.make({});
    const std::int64_t begin = now_ns();
    for (const control::Measurement& measured : seen) {
      control::Setpoint setpoint = run.step(measured);
      ::benchmark::DoNotOptimize(setpoint);
    }
    return static_cast<double>(now_ns() - begin) / static_cast<double>(seen.size());
  });
  Row row = {.name = fmt::format("update, {}", name),
             .unit = "ns",
             .measured = median(rounds.results, [](double ns) { return ns; }),
             .disturbance = rounds.disturbance};
  if (name == "book/8.2.2") row.limit = Limit{Limit::Kind::kAtMost, kMostUpdateNs};
  return row;
}

/// Plant time over wall time of a controller and its bench in one process.
Row closed_loop_of(std::string_view name) {
  const control::Preset& preset = *control::find_preset(name);
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] {
    InProcess loop(preset);
    const std::int64_t begin = now_ns();
    while (!loop.run().done())
      loop.step();
    const double wall_s = static_cast<double>(now_ns() - begin) * 1e-9;
    return static_cast<double>(loop.run().planned_samples()) * loop.run().period_s() / wall_s;
  });
  Row row = {.name = fmt::format("closed loop in process against real time, {}", name),
             .unit = "x",
             .measured = median(rounds.results, [](double times) { return times; }),
             .disturbance = rounds.disturbance};
  if (name == "book/8.2.2") row.limit = Limit{Limit::Kind::kAtLeast, kLeastTimesRealTime};
  return row;
}

}  // namespace

std::vector<Row> measure() {
  std::vector<Row> rows;
  for (const std::string_view name :
       {"book/8.2.2", "book/8.2.5-soft-flux", "book/9.1.4", "book/10.6", "wound-rotor/servo", "book/2.18"}) {
    rows.push_back(update_of(name));
    rows.push_back(closed_loop_of(name));
  }
  return rows;
}

}  // namespace drivebench::speed::controllers
