#include <cstdio>
#include <numbers>
#include <utility>

#include "clients/link/tcp/tcp_link.hpp"

/// Turns a DC servo by half a turn; the bench is `drivebench serve dc-a-servo`. Argument: the address of
/// another bench.
int main(int argc, char** argv) {
  using namespace drivebench;
  link::Link bench(argc > 1 ? argv[1] : "tcp:127.0.0.1:7300");
  bench.acquire(0);                                      // the lease of axis 0: only its holder may command
  auto sample = bench.exchange({}).samples(0).sample();  // the sensors at tick 0
  double angle_rad = 0.0, speed_rad_s = 0.0;
  while (sample.tick() < 5000) {  // half a second at 10 kHz
    const auto count = static_cast<double>(sample.encoder_count());
    const double before_rad = std::exchange(angle_rad, count * std::numbers::pi / 1000);
    speed_rad_s += 0.05 * ((angle_rad - before_rad) / 1e-4 - speed_rad_s);
    const double i_a = 8.6 * (std::numbers::pi - angle_rad) - 0.12 * speed_rad_s;
    const link::AxisCommand command{.tick = sample.tick(), .gates = v1::GATES_CURRENT, .i_a_a = i_a};
    sample = bench.exchange({&command, 1}).samples(0).sample();  // the sensors one tick later
  }
  std::printf("turned by %.3f rad of %.3f\n", angle_rad, std::numbers::pi);
}
