#include <fmt/core.h>
#include <sys/socket.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "clients/command/installation.hpp"
#include "clients/link/tcp_link.hpp"
#include "tests/benchmark/machine.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/benchmark/server.hpp"

namespace drivebench::speed {
namespace {

using namespace std::chrono_literals;

constexpr double kMaxMiB = 64.0;
constexpr double kMaxGrowthMiB = 1.0;  // "flat"
constexpr int kViewers = 32;
constexpr std::uint32_t kDecimation = 8;  // 1 kHz
constexpr auto kWarmUp = 5s;

/// Who listens on a unix socket.
pid_t listener_of(const std::string& path) {
  const link::FileDescriptor socket = link::connect_to({.host = {}, .port = {}, .path = path}, 5s);
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (::getsockopt(socket.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) {
    throw std::system_error(errno, std::generic_category(), "SO_PEERCRED");
  }
  return peer.pid;
}

double resident_mib(pid_t pid) {
  std::ifstream status(fmt::format("/proc/{}/status", pid));
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stod(line.substr(6)) / 1024.0;
  }
  throw std::runtime_error("the server is gone");
}

/// A controller at the pace of the bench and viewers who take what they are sent, on two threads.
class Company {
 public:
  explicit Company(const std::string& address) : controller_(address) {
    controller_.acquire(0);
    for (int i = 0; i < kViewers; ++i) {
      viewers_.push_back(std::make_unique<link::Link>(address));
      viewers_.back()->subscribe(0, kDecimation);
    }
    control_ = std::thread([this] { guarded([this] { control(); }); });
    watch_ = std::thread([this] { guarded([this] { watch(); }); });
  }
  ~Company() { leave(); }
  Company(const Company&) = delete;
  Company& operator=(const Company&) = delete;

  void leave() {
    stop_.store(true);
    if (control_.joinable()) control_.join();
    if (watch_.joinable()) watch_.join();
  }

  bool failed() const { return failed_.load(); }
  std::uint64_t exchanges() const { return exchanges_.load(); }
  std::uint64_t timeouts() const { return timeouts_.load(); }
  std::uint64_t seen() const { return seen_.load(); }
  std::uint64_t dropped() const { return dropped_.load(); }

 private:
  template <class Work>
  void guarded(Work work) noexcept {
    try {
      work();
    } catch (const std::exception& error) {
      fmt::print(stderr, "memory: {}\n", error.what());
      failed_.store(true);
    }
  }

  void control() {
    std::uint64_t tick = newest_tick();
    while (!stop_.load()) {
      const TwoPhase& u = line_voltages()[tick % line_voltages().size()];
      const link::Command command{
          .axis = 0, .tick = tick, .gates = v1::GATES_VOLTAGE, .u_a_v = u.a, .u_b_v = u.b};
      try {
        tick = controller_.exchange({&command, 1}).samples(0).sample().tick();
        ++exchanges_;
      } catch (const link::Refused&) {  // on a busy machine a command may come too late for the watchdog
        ++timeouts_;
        controller_.clear_faults(0);
        tick = newest_tick();
      }
    }
  }

  std::uint64_t newest_tick() { return controller_.exchange({}).samples(0).sample().tick(); }

  void watch() {
    while (!stop_.load()) {
      for (const auto& viewer : viewers_) {
        while (const auto samples = viewer->next_samples(0ms)) {
          seen_ += static_cast<std::uint64_t>(samples->samples_size());
          dropped_ += samples->dropped();
        }
      }
      std::this_thread::sleep_for(5ms);
    }
  }

  link::Link controller_;
  std::vector<std::unique_ptr<link::Link>> viewers_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> failed_{false};
  std::atomic<std::uint64_t> exchanges_{0};
  std::atomic<std::uint64_t> timeouts_{0};
  std::atomic<std::uint64_t> seen_{0};
  std::atomic<std::uint64_t> dropped_{0};
  std::thread control_;
  std::thread watch_;
};

/// Highest resident memory until `end`.
double peak_until(std::chrono::steady_clock::time_point end, pid_t server, const Company& company) {
  double peak_mib = 0.0;
  do {
    std::this_thread::sleep_for(100ms);
    if (company.failed()) throw std::runtime_error("a client lost its link");
    peak_mib = std::max(peak_mib, resident_mib(server));
  } while (std::chrono::steady_clock::now() < end);
  return peak_mib;
}

}  // namespace

std::vector<Row> measure_memory(const Plan& plan) {
  const ScratchFolder folder;
  const std::string path = folder / "bench.socket";
  Server server({command::find_config("servo-realtime").string(), "--unix", path});
  const pid_t pid = listener_of(path);
  Company company(server.address());

  const auto begin = std::chrono::steady_clock::now();
  const auto soak = std::chrono::duration<double, std::ratio<60>>(plan.soak_minutes);
  peak_until(begin + kWarmUp, pid, company);
  const double early_mib = resident_mib(pid);
  const double peak_mib =
      peak_until(begin + std::chrono::duration_cast<std::chrono::nanoseconds>(soak), pid, company);
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  company.leave();
  server.stop();
  return {
      {.name = "resident memory of the server",
       .unit = "MiB",
       .measured = peak_mib,
       .limit = Limit{Limit::Kind::kAtMost, kMaxMiB},
       .note = fmt::format(
           "1 controller ({:.0f} commands/s, {} timeouts), {} viewers ({:.0f} samples/s each, {} dropped)",
           static_cast<double>(company.exchanges()) / elapsed_s, company.timeouts(), kViewers,
           static_cast<double>(company.seen()) / elapsed_s / kViewers, company.dropped())},
      {.name = "its growth",
       .unit = "MiB",
       .measured = peak_mib - early_mib,
       .limit = Limit{Limit::Kind::kAtMost, kMaxGrowthMiB},
       .note = fmt::format("from 5 s to {:.0f} s", elapsed_s)}};
}

}  // namespace drivebench::speed
