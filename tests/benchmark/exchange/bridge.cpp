#include <drivebench_bridge.h>
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"
#include "tests/clients/sdk/leg_setting.hpp"

namespace drivebench::speed::bridge {
namespace {

constexpr double kMostIdleNs = 30.0;
constexpr double kMostEdgeNs = 1000.0;
constexpr double kMostSecondsPerSecond = 0.15;
constexpr int kPolePairs = 7;
constexpr std::uint64_t kPwmPs = 20'833'333;  // 48 kHz
constexpr std::uint64_t kAskPs = 500'000;     // 2 million times in a simulated second
constexpr double kWantedRpm = 9000.0;

void check(drivebench_bridge* bridge, int code) {
  if (code != DRIVEBENCH_OK) throw std::runtime_error(drivebench_bridge_error(bridge));
}

/// A speed controller that knows the angle: six edges of the legs in an electrical turn, and PWM.
class Controller {
 public:
  Controller() { check(nullptr, drivebench_bridge_open("inproc:esc", 0, &bridge_)); }
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;
  ~Controller() { drivebench_bridge_close(bridge_); }

  double rpm() { return read().speed_rad_s * 30.0 / std::numbers::pi; }

  /// Runs so long, and asks every half microsecond; the edges on the way.
  std::size_t run_for(double seconds) {
    std::array<drivebench_bridge_edge, 16> edges;
    std::size_t seen = 0;
    const std::uint64_t end = now_ + static_cast<std::uint64_t>(1e12 * seconds);
    while (now_ < end) {
      if (now_ >= commutate_at_) commutate();
      std::size_t count = 0;
      const std::uint64_t until = std::min(std::max(commutate_at_, now_ + 1), now_ + kAskPs);
      check(bridge_, drivebench_bridge_run(bridge_, until, edges.data(), edges.size(), &count, &now_));
      seen += count;
    }
    return seen;
  }

  /// A run of a picosecond [ns].
  double idle_ns(int runs) {
    const std::int64_t begin = now_ns();
    for (int k = 0; k < runs; ++k)
      check(bridge_, drivebench_bridge_run(bridge_, now_ + 1, nullptr, 0, nullptr, &now_));
    return static_cast<double>(now_ns() - begin) / runs;
  }

  /// A step of the plant: from one change of a voltage or point of the grid to the next [ns].
  double step_ns(double seconds, double steps_per_s) {
    const std::int64_t begin = now_ns();
    check(bridge_, drivebench_bridge_run(bridge_, now_ + static_cast<std::uint64_t>(1e12 * seconds), nullptr,
                                         0, nullptr, &now_));
    return static_cast<double>(now_ns() - begin) / (seconds * steps_per_s);
  }

 private:
  drivebench_bridge_state read() {
    drivebench_bridge_state state;
    check(bridge_, drivebench_bridge_read(bridge_, &state));
    return state;
  }

  void commutate() {
    constexpr std::array<std::array<std::uint32_t, 3>, 6> kLegs{
        {{1, 2, 0}, {1, 0, 2}, {2, 0, 1}, {2, 1, 0}, {0, 1, 2}, {0, 2, 1}}};  // high, low, open
    constexpr double kSector = std::numbers::pi / 3.0;
    const drivebench_bridge_state is = read();
    // Step 2 lies around 120 electrical degrees.
    const double place = kPolePairs * is.angle_rad / kSector + 0.5;
    const auto step = static_cast<std::int64_t>(std::floor(place + 1e-9));
    const std::array<std::uint32_t, 3>& legs = kLegs[static_cast<std::size_t>(((step % 6) + 6) % 6)];
    const double duty = is.speed_rad_s * 30.0 / std::numbers::pi < kWantedRpm ? 0.85 : 0.55;
    set(legs[2], leg_at(DRIVEBENCH_LEG_OPEN));
    set(legs[1], leg_at(DRIVEBENCH_LEG_LOW, 0, 0, 200'000));
    set(legs[0], leg_at(DRIVEBENCH_LEG_PWM, kPwmPs,
                        static_cast<std::uint64_t>(duty * static_cast<double>(kPwmPs)), 200'000));
    const double rate = kPolePairs * std::max(std::abs(is.speed_rad_s), 1.0) / kSector;
    const double wait_s = std::min(0.5e-3, (static_cast<double>(step) + 1.0 - place) / rate);
    commutate_at_ = now_ + std::max<std::uint64_t>(1'000'000, static_cast<std::uint64_t>(1e12 * wait_s));
  }

  void set(std::uint32_t leg, const drivebench_leg& setting) {
    check(bridge_, drivebench_bridge_set(bridge_, leg, &setting));
  }

  drivebench_bridge* bridge_ = nullptr;
  std::uint64_t now_ = 0;
  std::uint64_t commutate_at_ = 0;
};

}  // namespace

std::vector<Row> measure() {
  const std::array cpu{cpu_pair().far};
  const Pinned pinned(cpu[0]);
  Controller controller;
  controller.run_for(planned(0.4, 0.05));
  const double rpm = controller.rpm();
  const double simulated_s = planned(0.1, 0.005);
  std::size_t edges = 0;
  const auto rounds = undisturbed_rounds(cpu, 10, [&] {
    const std::int64_t begin = now_ns();
    edges = controller.run_for(simulated_s);
    return 1e-9 * static_cast<double>(now_ns() - begin) / simulated_s;
  });
  const auto idle = undisturbed_rounds(cpu, 10, [&] { return controller.idle_ns(1000); });
  // The leg's voltage moves twice in a period, its dead times lie beside diodes; and a step of the grid in 20
  // us.
  const double steps_per_s = 2e12 / static_cast<double>(kPwmPs) + 50e3;
  const auto step = undisturbed_rounds(cpu, 10, [&] { return controller.step_ns(0.001, steps_per_s); });
  return {{.name = "gate level, a run with nothing due",
           .unit = "ns",
           .measured = percentile(idle.results, 0.5),
           .limit = Limit{Limit::Kind::kAtMost, kMostIdleNs},
           .disturbance = idle.disturbance},
          {.name = "gate level, a step of the plant",
           .unit = "ns",
           .measured = percentile(step.results, 0.5),
           .limit = Limit{Limit::Kind::kAtMost, kMostEdgeNs},
           .disturbance = step.disturbance,
           .note = "PWM of 48 kHz with dead time, comparators, a battery"},
          {.name = "gate level, a second of a speed controller",
           .unit = "s",
           .measured = percentile(rounds.results, 0.5),
           .limit = Limit{Limit::Kind::kAtMost, kMostSecondsPerSecond},
           .disturbance = rounds.disturbance,
           .note = fmt::format("7 pole pairs at {:.0f} rpm, asked 2 million times, {:.0f} edges", rpm,
                               static_cast<double>(edges) / simulated_s)}};
}

}  // namespace drivebench::speed::bridge
