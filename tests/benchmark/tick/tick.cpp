#include <benchmark/benchmark.h>
#include <fmt/core.h>

#include <array>
#include <cmath>
#include <stdexcept>
#include <variant>

#include "server/bench/bench.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/spsc_queue.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/benchmark/tick/bare_machines.hpp"

namespace drivebench::speed::tick {
namespace {

constexpr double kMaxRatio = 4.0;
constexpr int kTicksPerBatch = 200;
constexpr int kBatchesPerRound = 200;
constexpr std::size_t kRounds = 20;
constexpr int kRunUpTicks = 16'000;  // 2 s: the line start is over
constexpr Owner kController = 1;

/// Copies what the bench reports into a queue as large as the recorder's. It is emptied between batches, by
/// the recorder's thread in the product.
class QueueTap final : public BenchObserver {
 public:
  void on_input(Tick now, const Input& input) noexcept override {
    queue_.emplace(std::in_place_type<ReceivedInput>, now, input);
  }
  void on_sample(std::uint32_t axis, const Sample& sample) noexcept override {
    queue_.emplace(std::in_place_type<TickedSample>, axis, sample);
  }

  void empty() noexcept {
    while (queue_.front() != nullptr)
      queue_.pop();
  }

 private:
  SpscQueue<RecordedEntry> queue_{17'024};
};

/// The bench under command, and the bare motor at the same voltages.
class Race {
 public:
  explicit Race(bool running)
      : config_(bench_config("servo")),
        bench_(config_.setup, &tap_),
        motor_(std::get<InductionMachineParameters>(config_.setup.axes[0].parameters.machine),
               config_.setup.axes[0].parameters.mechanics, 0.0, 0.0),
        substeps_(config_.setup.substeps),
        step_s_(static_cast<double>(config_.setup.period_ns) * 1e-9 / substeps_),
        voltages_(running ? line_voltages() : std::vector<TwoPhase>(1)) {
    bench_.submit({.tick = 0, .axis = 0, .owner = kController, .action = LeaseAction::kAcquire});
    for (int k = 0; k < kRunUpTicks; ++k) {
      run_bench(1);
      tap_.empty();
    }
    const Sample& s = bench_.sample(0);
    bare_ = {s.true_i_a_a, s.true_i_b_a, s.psi_a_wb, s.psi_b_wb, s.speed_rad_s, s.angle_rad};
    bare_tick_ = bench_.tick();
  }

  double bench_batch_ns() {
    const std::int64_t begin = now_ns();
    run_bench(kTicksPerBatch);
    const double elapsed_ns = static_cast<double>(now_ns() - begin);
    tap_.empty();
    return elapsed_ns / kTicksPerBatch;
  }

  double bare_batch_ns() {
    const std::int64_t begin = now_ns();
    for (int k = 0; k < kTicksPerBatch; ++k, ++bare_tick_) {
      const TwoPhase u = voltage_at(bare_tick_);
      motor_.ua = u.a;
      motor_.ub = u.b;
      for (int n = 0; n < substeps_; ++n)
        bare_ = BareInduction::Rk4::step(motor_, bare_, step_s_);
      ::benchmark::DoNotOptimize(bare_);
    }
    return static_cast<double>(now_ns() - begin) / kTicksPerBatch;
  }

  /// The ratio has a meaning only if both have simulated the same motor.
  void check_same_motion() const {
    const double speed_rad_s = bench_.sample(0).speed_rad_s;
    if (bare_tick_ != bench_.tick() || std::abs(speed_rad_s - bare_.w) > 1e-6) {
      throw std::runtime_error(
          fmt::format("the bare motor turns at {} rad/s, the bench at {}", bare_.w, speed_rad_s));
    }
  }
  double speed_rad_s() const { return bare_.w; }

 private:
  TwoPhase voltage_at(Tick tick) const noexcept {
    return voltages_[static_cast<std::size_t>(tick) % voltages_.size()];
  }

  void run_bench(int ticks) noexcept {
    for (int k = 0; k < ticks; ++k) {
      const Tick now = bench_.tick();
      bench_.submit(
          {.tick = now,
           .axis = 0,
           .owner = kController,
           .action = Command{.answers = now,
                             .phases = {.gates = Gates::kVoltage,
                                        .setpoint = {.a = voltage_at(now).a, .b = voltage_at(now).b}}}});
      bench_.step();
      ::benchmark::DoNotOptimize(bench_.sample(0));
    }
  }

  BenchConfig config_;
  QueueTap tap_;
  Bench bench_;
  BareInduction motor_;
  int substeps_;
  double step_s_;
  std::vector<TwoPhase> voltages_;
  BareInduction::State bare_{};
  Tick bare_tick_ = 0;
};

struct Round {
  double bench_ns;
  double bare_ns;
};

Round one_round(Race& race) {
  std::vector<double> bench_ns;
  std::vector<double> bare_ns;
  for (int batch = 0; batch < kBatchesPerRound; ++batch) {
    bench_ns.push_back(race.bench_batch_ns());
    bare_ns.push_back(race.bare_batch_ns());
  }
  return {.bench_ns = percentile(bench_ns, 0.5), .bare_ns = percentile(bare_ns, 0.5)};
}

Row row_of(const std::string& name, bool running) {
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  Race race(running);
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] { return one_round(race); });
  race.check_same_motion();
  const double bare_ns = median(rounds.results, &Round::bare_ns);
  return {.name = name,
          .unit = "ns",
          .measured = median(rounds.results, &Round::bench_ns),
          .floor = bare_ns,
          .limit = Limit{Limit::Kind::kRatioAtMost, kMaxRatio},
          .disturbance = rounds.disturbance,
          .note = fmt::format("{:.1f} rad/s; floor: the bare RK4, {:.1f} ns a step", race.speed_rad_s(),
                              bare_ns / bench_config("servo").setup.substeps)};
}

}  // namespace

std::vector<Row> measure() {
  return {row_of("tick, standing", false), row_of("tick, turning", true)};
}

}  // namespace drivebench::speed::tick
