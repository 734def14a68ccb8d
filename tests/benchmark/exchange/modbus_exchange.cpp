#include <fmt/core.h>

#include <array>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "clients/command/common/programs/installation.hpp"
#include "protocols/modbus/register_map.hpp"
#include "tests/benchmark/exchange/plain_modbus.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::modbus_exchange {
namespace {

constexpr double kMaxP50Ratio = 1.3;
constexpr std::size_t kBlock = 2000;
constexpr std::size_t kRounds = 10;

/// Mode, counter and the two voltages of the command block.
constexpr int kCommandAddress = modbus::kCommandStart + 2;
constexpr int kCommandLength = 7;

/// A controller by function 23: one request writes the command and reads the sample.
class Controller {
 public:
  explicit Controller(std::uint16_t port) : client_(connect_modbus(port)) {}

  /// Takes the axis of a bench.
  void acquire() {
    check(::modbus_write_register(client_.get(), modbus::kCommandStart, 4711) == 1, "taking the lease");
    check(::modbus_read_registers(client_.get(), modbus::kSampleStart, modbus::kSampleLength,
                                  answer_.data()) == modbus::kSampleLength,
          "reading the sample");
    sample_ = modbus::read_sample(answer_);
  }

  /// One exchange, with the product or with plain libmodbus.
  void exchange() {
    const TwoPhase& u = line_voltages()[sample_.tick % line_voltages().size()];
    std::array<std::uint16_t, kCommandLength> command{1};
    const auto put = [&](std::size_t at, modbus::Type type, std::uint64_t bits) {
      modbus::put(bits, type, modbus::WordOrder::kAbcd, &command[at]);
    };
    put(1, modbus::Type::kUnsigned32, sample_.tick);
    put(3, modbus::Type::kFloat32, modbus::float_bits(u.a));
    put(5, modbus::Type::kFloat32, modbus::float_bits(u.b));
    check(::modbus_write_and_read_registers(client_.get(), kCommandAddress, kCommandLength, command.data(),
                                            modbus::kSampleStart, modbus::kSampleLength,
                                            answer_.data()) == modbus::kSampleLength,
          "the exchange");
    sample_ = modbus::read_sample(answer_);
  }

  std::uint64_t tick() const noexcept { return sample_.tick; }

 private:
  ModbusContext client_;
  std::array<std::uint16_t, modbus::kSampleLength> answer_{};
  Sample sample_;
};

struct Round {
  Percentiles plain, bench;
};

Rounds<Round> alternate(Controller& plain, Controller& bench, CpuPair cpu) {
  const Pinned pinned(cpu.near);
  const std::array cpus{cpu.near, cpu.far};
  return undisturbed_rounds(cpus, kRounds, [&]() -> Round {
    const std::uint64_t before = bench.tick();
    const Round round{.plain = time_exchanges(kBlock, [&] { plain.exchange(); }),
                      .bench = time_exchanges(kBlock, [&] { bench.exchange(); })};
    if (bench.tick() != before + kBlock) throw std::runtime_error("an exchange did not run exactly one tick");
    return round;
  });
}

Row row(const char* name, const Rounds<Round>& rounds, double Percentiles::*figure,
        std::optional<double> max) {
  Row row{.name = name,
          .unit = "us",
          .measured = median(rounds.results, [&](const Round& round) { return round.bench.*figure; }),
          .floor = median(rounds.results, [&](const Round& round) { return round.plain.*figure; }),
          .disturbance = rounds.disturbance};
  if (max) row.limit = Limit{Limit::Kind::kRatioAtMost, *max};
  return row;
}

}  // namespace

std::vector<Row> measure() {
  const CpuPair cpu = cpu_pair();
  const ScratchFolder folder;
  auto pinned = std::make_unique<Pinned>(cpu.far);  // the servers inherit it
  BenchConfig config = load_config(command::find_config("servo-modbus"));
  config.modbus.port = 0;
  const std::filesystem::path file = folder / "bench.toml";
  if (!(std::ofstream(file) << to_toml(config))) throw std::runtime_error("cannot write " + file.string());
  Server server({file.string()});
  PlainModbusServer plain_server;
  pinned.reset();
  Controller bench(server.modbus_port());
  Controller plain(plain_server.port());
  bench.acquire();
  for (std::size_t k = 0; k < 2 * kBlock; ++k)
    bench.exchange();

  const Rounds<Round> across = alternate(plain, bench, cpu);
  const Rounds<Round> same = alternate(plain, bench, {.near = cpu.far, .far = cpu.far});
  std::vector<Row> rows{row("modbus exchange p50", across, &Percentiles::p50, kMaxP50Ratio),
                        row("modbus exchange p99", across, &Percentiles::p99, {}),
                        row("modbus exchange p50, one CPU", same, &Percentiles::p50, kMaxP50Ratio)};
  rows[0].note = fmt::format(
      "function 23, {} registers out and {} back, client libmodbus; floor: a plain libmodbus server, {}",
      kCommandLength, modbus::kSampleLength, cpu.near != cpu.far ? "across CPUs" : "on one CPU");
  return rows;
}

}  // namespace drivebench::speed::modbus_exchange
