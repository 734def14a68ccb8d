#include <cstdio>
#include <drivebench.hpp>
#include <numbers>
#include <utility>

/// Turns a DC servo by half a turn; the bench is `drivebench serve dc-a-servo`. Argument: the address of
/// another bench, for example inproc:dc-a-servo, which needs no server.
int main(int argc, char** argv) {
  using namespace drivebench;
  client::Bench bench(argc > 1 ? argv[1] : "tcp:127.0.0.1:7300");
  bench.acquire();               // the lease of axis 0: only its holder may command
  auto sample = bench.newest();  // the sensors at tick 0
  double angle_rad = 0.0, speed_rad_s = 0.0;
  while (sample.tick < 5000) {  // half a second at 10 kHz
    const auto count = static_cast<double>(sample.encoder_count);
    const double before_rad = std::exchange(angle_rad, count * std::numbers::pi / 1000);
    speed_rad_s += 0.05 * ((angle_rad - before_rad) / 1e-4 - speed_rad_s);
    const double i_a = 8.6 * (std::numbers::pi - angle_rad) - 0.12 * speed_rad_s;
    const client::Command command{.gates = DRIVEBENCH_GATES_CURRENT, .tick = sample.tick, .setpoint_a = i_a};
    sample = bench.step(command);  // the sensors one tick later
  }
  std::printf("turned by %.3f rad of %.3f\n", angle_rad, std::numbers::pi);
}
