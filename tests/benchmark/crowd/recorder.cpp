#include "server/recording/recorder.hpp"

#include <fmt/core.h>

#include <array>
#include <fstream>
#include <stdexcept>

#include "protocols/mcap/mcap.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::recorder {
namespace {

constexpr std::size_t kAxes = 10;
constexpr std::int64_t kPeriodNs = 50'000;
constexpr Owner kController = 1;

/// 10 s.
Tick ticks() noexcept {
  return planned<Tick>(200'000, 2'000);
}

BenchConfig ten_axes() {
  BenchConfig config = bench_config("servo");
  config.setup.period_ns = kPeriodNs;
  config.setup.axes.resize(kAxes, config.setup.axes[0]);
  config.axes.resize(kAxes, config.axes[0]);
  for (std::size_t axis = 0; axis < kAxes; ++axis)
    config.axes[axis].name = fmt::format("servo{}", axis);
  return config;
}

/// All axes turn under command: every tick gives the recorder ten inputs and ten samples.
void run_in_real_time(Bench& bench) {
  for (std::uint32_t axis = 0; axis < kAxes; ++axis)
    bench.submit({.tick = 0, .axis = axis, .owner = kController, .action = LeaseAction::kAcquire});
  const auto pacer = make_realtime_pacer(PacerKind::kSleep, kPeriodNs);
  while (bench.tick() < ticks()) {
    pacer->wait();
    const Tick now = bench.tick();
    const TwoPhase& u = line_voltages()[static_cast<std::size_t>(now) % line_voltages().size()];
    for (std::uint32_t axis = 0; axis < kAxes; ++axis) {
      bench.submit(
          {.tick = now,
           .axis = axis,
           .owner = kController,
           .action = Command{.answers = now,
                             .phases = {.gates = Gates::kVoltage, .setpoint = {.a = u.a, .b = u.b}}}});
    }
    bench.step();
  }
}

std::uint64_t messages_in(const std::filesystem::path& recording) {
  std::vector<std::byte> bytes(std::filesystem::file_size(recording));
  std::ifstream file(recording, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  McapReader reader(bytes);
  for (McapMessage message; reader.next(message);) {
  }
  if (!file || reader.problem()) throw std::runtime_error("the recording is damaged");
  return reader.message_count();
}

}  // namespace

std::vector<Row> measure() {
  const BenchConfig config = ten_axes();
  const ScratchFolder folder;
  const std::filesystem::path file = folder / "ten-axes.mcap";
  Canary canary;
  const std::array cpus{cpu_pair().near, cpu_pair().far};
  canary.look(cpus);
  Recorder recorder(file, config);
  Bench bench(config.setup, &recorder);
  const std::int64_t begin = now_ns();
  run_in_real_time(bench);
  const double elapsed_s = static_cast<double>(now_ns() - begin) * 1e-9;
  recorder.finish({.ticks = static_cast<std::uint64_t>(ticks()), .state_hash = bench.state_hash()});
  canary.look(cpus);

  // Samples (one more: that of tick 0), commands, leases, the verdict.
  const auto ticked = static_cast<std::uint64_t>(ticks());
  const std::uint64_t wanted = kAxes * (ticked + 1) + kAxes * ticked + kAxes + 1;
  if (messages_in(file) + recorder.gaps() != wanted)
    throw std::runtime_error("the recorder did not count a gap");
  const double megabytes = static_cast<double>(std::filesystem::file_size(file)) * 1e-6;
  return {
      {.name = "gaps, 10 axes at 20 kHz",
       .measured = static_cast<double>(recorder.gaps()),
       .limit = Limit{Limit::Kind::kAtMost, 0.0},
       .disturbance = canary.seen(),
       .note = fmt::format("{} entries in {:.2f} s, {:.0f} MB/s", wanted, elapsed_s, megabytes / elapsed_s)}};
}

}  // namespace drivebench::speed::recorder
