#pragma once

#include "server/config/config.hpp"
#include "tests/adversity/simulator/peers/stream_client.hpp"
#include "tests/adversity/simulator/world/random.hpp"

namespace drivebench::simulator {

/// The bench of a seed: one of configs/benches or several servo axes, its time, its watchdog and its lease.
BenchConfig draw_bench(Random& random);

/// The clients of a seed: a healthy viewer first, then a random number of others.
std::vector<Manners> draw_clients(Random& random, const BenchConfig& config);

}  // namespace drivebench::simulator
