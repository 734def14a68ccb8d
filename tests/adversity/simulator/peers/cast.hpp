#pragma once

#include "server/config/config.hpp"
#include "tests/adversity/simulator/peers/stream_client.hpp"
#include "tests/adversity/simulator/world/random.hpp"

namespace drivebench::simulator {

/// Of the subjects of benches that ask for tokens.
inline constexpr const char* kAdminToken = "the token of the laboratory";
inline constexpr const char* kGuestToken = "the token of a guest";

/// The bench of a seed: one of configs/benches or several servo axes, its time, its watchdog and its lease.
BenchConfig draw_bench(Random& random);

/// The clients of a seed: a healthy viewer first, then a random number of others.
std::vector<Manners> draw_clients(Random& random, const BenchConfig& config);

}  // namespace drivebench::simulator
