#include <fmt/core.h>

#include <array>
#include <fstream>
#include <stdexcept>

#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::free_mode {
namespace {

constexpr double kMinTimesRealTime = 150.0;
constexpr std::size_t kRounds = 3;

/// The servo with a load that drives its shaft: there is no controller in free mode. It ends at 125 rad/s.
void write_turning_bench(const std::filesystem::path& file) {
  BenchConfig config = bench_config("servo");
  config.mode = RunMode::kFree;
  config.axes[0].events = {{.tick = 0, .action = LoadChange{.load_nm = -0.0175, .ramp_ticks = 0}}};
  if (!(std::ofstream(file) << to_toml(config))) throw std::runtime_error("cannot write " + file.string());
}

double wall_s(const std::filesystem::path& bench, const std::filesystem::path& recording, int duration_s) {
  const std::int64_t begin = now_ns();
  Server server({bench.string(), "--duration", std::to_string(duration_s), "--record", recording.string()});
  const nlohmann::json verdict = server.wait(std::chrono::seconds(60));
  const double elapsed_s = static_cast<double>(now_ns() - begin) * 1e-9;
  std::filesystem::remove(recording);
  if (verdict.at("ticks") != duration_s * 8000 || verdict.at("gaps") != 0) {
    throw std::runtime_error("the free run is not whole: " + verdict.dump());
  }
  return elapsed_s;
}

struct Round {
  double times_real_time;
  double start_s;
};

}  // namespace

std::vector<Row> measure() {
  const int short_run_s = planned(20, 1);
  const int long_run_s = planned(120, 3);
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);  // the server inherits it: tick, recorder and this program share one CPU
  const ScratchFolder folder;
  write_turning_bench(folder / "turning.toml");
  const auto rounds = undisturbed_rounds(cpu, kRounds, [&]() -> Round {
    const double short_s = wall_s(folder / "turning.toml", folder / "short.mcap", short_run_s);
    const double long_s = wall_s(folder / "turning.toml", folder / "long.mcap", long_run_s);
    const double times_real_time = (long_run_s - short_run_s) / (long_s - short_s);
    return {.times_real_time = times_real_time, .start_s = short_s - short_run_s / times_real_time};
  });
  return {{.name = "free mode with recording, one CPU",
           .unit = "x",
           .measured = median(rounds.results, &Round::times_real_time),
           .limit = Limit{Limit::Kind::kAtLeast, kMinTimesRealTime},
           .disturbance = rounds.disturbance,
           .note = fmt::format("times real time at 8 kHz, start-up ({:.0f} ms) left out",
                               1e3 * median(rounds.results, &Round::start_s))}};
}

}  // namespace drivebench::speed::free_mode
