#include <fmt/core.h>

#include <atomic>
#include <memory>
#include <stdexcept>
#include <thread>

#include "clients/command/common/programs/installation.hpp"
#include "clients/link/tcp/tcp_link.hpp"
#include "tests/benchmark/crowd/viewers.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::memory {
namespace {

using namespace std::chrono_literals;

constexpr double kMaxMiB = 64.0;
constexpr double kMaxGrowthMiB = 1.0;  // "flat"
constexpr int kViewers = 32;
constexpr std::uint32_t kDecimation = 8;  // 1 kHz
constexpr auto kWarmUp = 5000ms;

/// A controller at the pace of the bench, on a thread of its own.
class Controller {
 public:
  explicit Controller(const std::string& address) : link_(address) {
    link_.acquire(0);
    thread_ = std::thread([this] {
      try {
        control();
      } catch (const std::exception& error) {
        fmt::print(stderr, "memory: {}\n", error.what());
        failed_.store(true);
      }
    });
  }
  ~Controller() {
    stop_.store(true);
    thread_.join();
  }
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  bool failed() const { return failed_.load(); }
  std::uint64_t exchanges() const { return exchanges_.load(); }
  std::uint64_t timeouts() const { return timeouts_.load(); }

 private:
  void control() {
    std::uint64_t tick = newest_tick();
    while (!stop_.load()) {
      const TwoPhase& u = line_voltages()[tick % line_voltages().size()];
      const link::AxisCommand command{
          .axis = 0, .tick = tick, .gates = v1::GATES_VOLTAGE, .u_a_v = u.a, .u_b_v = u.b};
      try {
        tick = link_.exchange({&command, 1}).front().sample.tick;
        ++exchanges_;
      } catch (const link::RefusalError&) {  // on a busy machine a command may come too late for the watchdog
        ++timeouts_;
        link_.clear_faults(0);
        tick = newest_tick();
      }
    }
  }

  std::uint64_t newest_tick() { return link_.exchange({}).front().sample.tick; }

  link::Link link_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> failed_{false};
  std::atomic<std::uint64_t> exchanges_{0};
  std::atomic<std::uint64_t> timeouts_{0};
  std::thread thread_;
};

/// Highest resident memory until `end`.
double peak_until(std::chrono::steady_clock::time_point end, pid_t server, const Controller& controller,
                  const Viewers& viewers) {
  double peak_mib = 0.0;
  do {
    std::this_thread::sleep_for(100ms);
    if (controller.failed() || viewers.failed()) throw std::runtime_error("a client lost its link");
    peak_mib = std::max(peak_mib, resident_mib(server));
  } while (std::chrono::steady_clock::now() < end);
  return peak_mib;
}

}  // namespace

std::vector<Row> measure() {
  const ScratchFolder folder;
  const std::string path = folder / "bench.socket";
  Server server({command::find_config("servo-realtime").string(), "--unix", path});
  const pid_t pid = listener_of(path);
  auto controller = std::make_unique<Controller>(server.address());
  auto viewers = std::make_unique<Viewers>(server.address(), kViewers);
  viewers->watch(kDecimation);

  const auto begin = std::chrono::steady_clock::now();
  const auto soak = std::chrono::duration<double, std::ratio<60>>(planned(plan().soak_minutes, 0.01));
  peak_until(begin + planned(kWarmUp, 100ms), pid, *controller, *viewers);
  const double early_mib = resident_mib(pid);
  const double peak_mib = peak_until(begin + std::chrono::duration_cast<std::chrono::nanoseconds>(soak), pid,
                                     *controller, *viewers);
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const std::string note = fmt::format(
      "1 controller ({:.0f} commands/s, {} timeouts), {} viewers ({:.0f} samples/s each, {} dropped)",
      static_cast<double>(controller->exchanges()) / elapsed_s, controller->timeouts(), kViewers,
      static_cast<double>(viewers->seen()) / elapsed_s / kViewers, viewers->dropped());
  controller.reset();
  viewers.reset();
  server.stop();
  return {{.name = "resident memory of the server",
           .unit = "MiB",
           .measured = peak_mib,
           .limit = Limit{Limit::Kind::kAtMost, kMaxMiB},
           .note = note},
          {.name = "its growth",
           .unit = "MiB",
           .measured = peak_mib - early_mib,
           .limit = Limit{Limit::Kind::kAtMost, kMaxGrowthMiB},
           .note = fmt::format("from 5 s to {:.0f} s", elapsed_s)}};
}

}  // namespace drivebench::speed::memory
