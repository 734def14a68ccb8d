#include <benchmark/benchmark.h>
#include <drivebench.h>
#include <fmt/core.h>

#include <array>
#include <cstring>
#include <drivebench.hpp>
#include <stdexcept>

#include "server/bench/bench.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::sdk {
namespace {

constexpr double kMaxOverheadNs = 100.0;
constexpr int kTicksPerBatch = 200;
constexpr int kBatchesPerRound = 200;
constexpr std::size_t kRounds = 20;
constexpr Owner kController = 1;

/// The same bench twice: behind the C ABI, and called directly. Both get the sample as a copy.
class Pair {
 public:
  Pair() : abi_("inproc:servo"), config_(bench_config("servo")), bench_(config_.setup) {
    abi_.acquire();
    bench_.submit({.tick = 0, .axis = 0, .owner = kController, .action = LeaseAction::kAcquire});
  }

  double abi_batch_ns() {
    const std::int64_t begin = now_ns();
    for (int k = 0; k < kTicksPerBatch; ++k) {
      through_abi_ = abi_.step({.gates = DRIVEBENCH_GATES_VOLTAGE,
                                .tick = through_abi_.tick,
                                .setpoint_a = 20.0,
                                .setpoint_b = 5.0});
      ::benchmark::DoNotOptimize(through_abi_);
    }
    return static_cast<double>(now_ns() - begin) / kTicksPerBatch;
  }

  double direct_batch_ns() {
    const std::int64_t begin = now_ns();
    for (int k = 0; k < kTicksPerBatch; ++k) {
      const Tick now = bench_.tick();
      bench_.submit(
          {.tick = now,
           .axis = 0,
           .owner = kController,
           .action = Command{.answers = now,
                             .phases = {.gates = Gates::kVoltage, .setpoint = {.a = 20.0, .b = 5.0}}}});
      bench_.step();
      direct_ = bench_.sample(0);
      ::benchmark::DoNotOptimize(direct_);
    }
    return static_cast<double>(now_ns() - begin) / kTicksPerBatch;
  }

  /// The difference has a meaning only if both have simulated the same.
  void check_same_bits() const {
    if (std::memcmp(&through_abi_, &direct_, sizeof direct_) != 0) {
      throw std::runtime_error("the samples behind the C ABI differ from those of the bench");
    }
  }

 private:
  client::Bench abi_;
  BenchConfig config_;
  Bench bench_;
  client::Sample through_abi_{};
  Sample direct_{};
};

struct Round {
  double abi_ns;
  double direct_ns;
};

Round one_round(Pair& pair) {
  std::vector<double> abi_ns;
  std::vector<double> direct_ns;
  for (int batch = 0; batch < kBatchesPerRound; ++batch) {
    abi_ns.push_back(pair.abi_batch_ns());
    direct_ns.push_back(pair.direct_batch_ns());
  }
  return {.abi_ns = percentile(abi_ns, 0.5), .direct_ns = percentile(direct_ns, 0.5)};
}

}  // namespace

std::vector<Row> measure() {
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  Pair pair;
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&] { return one_round(pair); });
  pair.check_same_bits();
  const double abi_ns = median(rounds.results, &Round::abi_ns);
  const double direct_ns = median(rounds.results, &Round::direct_ns);
  return {{.name = "step behind the C ABI",
           .unit = "ns",
           .measured = abi_ns,
           .floor = direct_ns,
           .limit = Limit{Limit::Kind::kExcessAtMost, kMaxOverheadNs},
           .disturbance = rounds.disturbance,
           .note = fmt::format("servo in process, {:.0f} times real time; floor: Bench::step",
                               static_cast<double>(bench_config("servo").setup.period_ns) / abi_ns)}};
}

}  // namespace drivebench::speed::sdk
