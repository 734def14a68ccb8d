#include <arpa/inet.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "clients/command/common/programs/installation.hpp"
#include "clients/link/tcp/tcp_link.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/child.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::experiment {
namespace {

constexpr double kMaxRatio = 2.0;
constexpr std::uint64_t kTicks = 200'000;  // 10 s at 20 kHz
constexpr std::size_t kRounds = 10;
constexpr std::size_t kBlock = std::size_t{128} * 1024;
constexpr auto kSignals =
    std::to_array<const char*>({"u_a_v", "u_b_v", "i_a_a", "i_b_a", "true_i_a_a", "true_i_b_a", "psi_a_wb",
                                "psi_b_wb", "angle_rad", "speed_rad_s", "torque_nm", "encoder_count"});
constexpr std::size_t kBytes = (kTicks + 1) * kSignals.size() * 8;
constexpr const char* kOwner = "the benchmark";

v1::RunExperiment request() {
  v1::RunExperiment r;
  r.set_owner(kOwner);
  r.set_mode(v1::MODE_FREE);
  r.set_ticks(kTicks);
  for (const char* const signal : kSignals)
    r.add_signals(signal);
  r.mutable_input()->set_kind(v1::INPUT_KIND_PHASE_VOLTAGES);
  v1::Shape::ThreePhase& line = *r.mutable_input()->add_shapes()->mutable_three_phase();
  line.set_amplitude(80.0);
  line.set_frequency_hz(60.0);
  return r;
}

/// Receives all data of an experiment; returns the seconds from the request to its end.
double fetch_s(link::Link& bench, std::uint64_t id) {
  v1::FetchExperiment wanted;
  wanted.set_id(id);
  wanted.set_owner(kOwner);
  const std::int64_t begin = now_ns();
  bench.begin_fetch(wanted);
  std::size_t bytes = 0;
  for (;;) {
    const v1::Envelope& message = bench.next_of_fetch();
    if (message.has_experiment_data()) {
      bytes += message.experiment_data().data().size();
    } else if (message.experiment_info().state() == v1::EXPERIMENT_STATE_COMPLETED) {
      break;
    } else if (message.experiment_info().state() > v1::EXPERIMENT_STATE_COMPLETED) {
      throw std::runtime_error("the experiment did not end well: " + message.experiment_info().reason());
    }
  }
  if (bytes != kBytes) throw std::runtime_error("the experiment has not all its data");
  return static_cast<double>(now_ns() - begin) * 1e-9;
}

/// The floor: a process that sends as many bytes from memory, over TCP with blocking calls, on each
/// request.
class RawCopy {
 public:
  RawCopy() : block_(kBlock) {
    const link::FileDescriptor listener(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    check(::bind(listener.get(), generic, size) == 0 && ::listen(listener.get(), 1) == 0, "listen");
    check(::getsockname(listener.get(), generic, &size) == 0, "getsockname");
    child_.emplace([&] { serve(::accept(listener.get(), nullptr, nullptr)); });
    socket_ =
        link::connect_to({.host = "127.0.0.1", .port = std::to_string(ntohs(address.sin_port)), .path = {}},
                         std::chrono::seconds(5));
  }

  double copy_s() {
    const std::int64_t begin = now_ns();
    check(::send(socket_.get(), "g", 1, MSG_NOSIGNAL) == 1, "send");
    for (std::size_t left = kBytes; left > 0;) {
      const ssize_t got = ::recv(socket_.get(), block_.data(), block_.size(), 0);
      check(got > 0, "recv");
      left -= static_cast<std::size_t>(got);
    }
    return static_cast<double>(now_ns() - begin) * 1e-9;
  }

 private:
  void serve(int socket) const {
    const std::vector<std::byte> bytes(kBytes);
    for (char go = 0; ::recv(socket, &go, 1, 0) == 1;) {
      for (std::size_t sent = 0; sent < kBytes;) {
        const ssize_t n = ::send(socket, bytes.data() + sent, std::min(kBlock, kBytes - sent), MSG_NOSIGNAL);
        if (n <= 0) return;
        sent += static_cast<std::size_t>(n);
      }
    }
  }

  std::vector<std::byte> block_;
  std::optional<Child> child_;
  link::FileDescriptor socket_;
};

struct Round {
  double fetch_s, copy_s;
};

/// The servo at 20 kHz, with a folder for experiments.
std::string bench_file(const ScratchFolder& folder) {
  BenchConfig config = bench_config("servo");
  config.setup.period_ns = 50'000;
  const std::string file = folder / "bench.toml";
  std::ofstream(file) << to_toml(config);
  return file;
}

}  // namespace

std::vector<Row> measure() {
  const CpuPair cpu = cpu_pair();
  const ScratchFolder folder;
  auto pinned = std::make_unique<Pinned>(cpu.far);
  Server server({bench_file(folder), "--experiments", folder / "kept"});
  RawCopy raw;
  pinned.reset();
  const Pinned near(cpu.near);
  link::Link bench(server.address(), {.deadline = std::chrono::seconds(30)});
  const std::uint64_t id = bench.run_experiment(request()).id();
  const double first_s = fetch_s(bench, id);
  const std::array cpus{cpu.near, cpu.far};
  const Rounds<Round> rounds = undisturbed_rounds(
      cpus, kRounds, [&]() -> Round { return {.fetch_s = fetch_s(bench, id), .copy_s = raw.copy_s()}; });
  const auto ms = [](double Round::*figure) {
    return [figure](const Round& round) { return 1e3 * (round.*figure); };
  };
  return {{.name = "experiment fetch, 10 s at 20 kHz",
           .unit = "ms",
           .measured = median(rounds.results, ms(&Round::fetch_s)),
           .floor = median(rounds.results, ms(&Round::copy_s)),
           .limit = Limit{Limit::Kind::kRatioAtMost, kMaxRatio},
           .disturbance = rounds.disturbance,
           .note = fmt::format("12 signals; floor: blocking TCP copy of the same {} bytes", kBytes)},
          {.name = "experiment run and fetch",
           .unit = "ms",
           .measured = 1e3 * first_s,
           .note = "the same while it runs as fast as it goes, recorded"}};
}

}  // namespace drivebench::speed::experiment
