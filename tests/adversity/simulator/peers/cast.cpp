#include "tests/adversity/simulator/peers/cast.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "tests/server/recording/run_config.hpp"

namespace drivebench::simulator {
namespace {

constexpr auto kBenches =
    std::to_array<const char*>({"servo", "servo", "dc-a-servo", "pm-stepper", "dynamometer", "dc-shunt-servo",
                                "stepper-current", "servo-hoist"});

/// Longer ticks with as many more steps: the same plant, fewer samples.
void stretch(BenchSetup& setup, std::int64_t factor) {
  setup.period_ns *= factor;
  setup.substeps *= static_cast<int>(factor);
}

CanConfig draw_bus(Random& random) {
  CanConfig can;
  can.profile.fd = random.chance(0.5);
  can.edges = can.profile.fd && random.chance(0.3);
  can.sample_every_ticks = random.between(1, 4);
  can.state_every_ticks = can.sample_every_ticks * 8;
  can.heartbeat_ms = 100;
  can.controller_timeout_ms = 200;
  can.idle_timeout_ms = 500;
  return can;
}

Manners honest(Random& random, Time period) {
  Manners m{.name = "controller"};
  m.quality = {.delay = random.between(0, 300) * kMicrosecond, .jitter = 100 * kMicrosecond, .torn = 0.05};
  m.read_every = std::max<Time>(period / 2, 500 * kMicrosecond);
  m.think = random.between(200, 4000) * kMicrosecond;
  m.controls = true;
  m.asks = 0.05;
  m.changes = 0.05;
  return m;
}

Manners sloppy(Random& random, Time period) {
  Manners m = honest(random, period);
  m.name = "sloppy controller";
  m.quality.jitter = random.between(1, 20) * kMillisecond;
  m.quality.torn = 0.3;
  m.lost = 0.1;
  m.twice = 0.1;
  m.wrong_tick = 0.1;
  m.wild = 0.02;
  m.stops = 0.002;
  m.gives = 0.01;
  m.changes = 0.2;
  m.leaves = 0.002;
  return m;
}

Manners fighter() {
  return {.name = "fighter",
          .quality = {.delay = kMillisecond, .jitter = 5 * kMillisecond, .torn = 0.2},
          .turn = 5 * kMillisecond,
          .takes = 0.5,
          .gives = 0.1,
          .forces = 0.01,
          .steals = 0.1,
          .clears = 0.2,
          .changes = 0.2,
          .wild = 0.1,
          .leaves = 0.005};
}

Manners slow_reader() {
  return {.name = "slow reader",
          .read_every = 300 * kMillisecond,
          .read_most = 4000,
          .asks = 0.5,
          .stops = 0.01,
          .every = 1};
}

Manners babbler() {
  return {
      .name = "babbler", .quality = {.torn = 0.5}, .takes = 0.1, .asks = 0.1, .babbles = 0.1, .leaves = 0.05};
}

Manners glutton() {
  return {.name = "glutton", .quality = {.torn = 0.2}, .asks = 0.2, .gorges = 0.3, .leaves = 0.01};
}

Manners guest() {
  return {.name = "guest",
          .token = kGuestToken,
          .turn = 10 * kMillisecond,
          .takes = 0.3,
          .steals = 0.5,
          .clears = 0.3,
          .changes = 0.3,
          .asks = 0.2,
          .every = 8};
}

/// Begins when the others are in: after its first guesses no token from their address is read.
Manners guesser() {
  return {.name = "guesser", .token = "a guess", .begins = 3 * kSecond, .turn = 2 * kMillisecond};
}

Manners silent() {
  return {.name = "silent", .turn = 100 * kMillisecond, .greets = false, .leaves = 0.01};
}

Manners leaver(Random& random, Time period) {
  Manners m = honest(random, period);
  m.name = "leaver";
  m.leaves = 0.05;
  m.shuts = 0.02;
  m.every = 4;
  return m;
}

}  // namespace

BenchConfig draw_bench(Random& random) {
  const std::uint64_t which = random.below(kBenches.size() + 2);
  BenchConfig config =
      which < kBenches.size()
          ? load_config(std::string(DRIVEBENCH_CONFIGS "/benches/") + kBenches[which] + ".toml")
          : servo_bench(2 + which % 2);
  constexpr auto kFactors = std::to_array<std::int64_t>({1, 2, 4, 8, 8, 16, 16, 16, 16, 16, 16, 16});
  std::int64_t factor = random.pick(std::span(kFactors));
  while (config.setup.substeps * factor > kMaxSubsteps && factor > 1)
    factor /= 2;
  stretch(config.setup, factor);
  // Short ticks make many samples; some seeds have them all the same.
  if (config.setup.period_ns < 400 * kMicrosecond && random.chance(0.85)) {
    config = servo_bench(1 + which % 2);
    stretch(config.setup, 8);
  }
  config.mode = random.chance(0.7) ? RunMode::kRealtime : RunMode::kLockstep;
  config.setup.command_delay_ticks =
      config.mode == RunMode::kRealtime ? 1 : static_cast<int>(random.below(2));
  config.setup.seed = 1 + random.below(1000);
  config.setup.watchdog_ticks = random.between(5, 100);
  config.setup.lease_ticks = std::max(random.between(200, 2000) * kMillisecond / config.setup.period_ns,
                                      config.setup.watchdog_ticks);
  config.realtime.max_lateness_ns = 100 * kMillisecond;
  config.tcp.port = 0;
  config.tcp.max_sessions = static_cast<std::uint32_t>(random.between(6, 12));
  config.tcp.asks_for_token = random.chance(0.3);
  if (config.tcp.asks_for_token) {
    config.tcp.grants = {{.name = "laboratory", .role = Role::kAdmin, .hash = hash_of_token(kAdminToken)},
                         {.name = "guest", .role = Role::kViewer, .hash = hash_of_token(kGuestToken)}};
  }
  config.can.clear();
  if (random.chance(0.35)) config.can.push_back(draw_bus(random));
  config.modbus = {};
  config.modbus.enabled = random.chance(0.35);
  config.modbus.port = 0;
  config.modbus.allow_writes = true;
  config.modbus.requests_per_s = random.chance(0.5) ? 0 : 150;
  config.modbus.idle_timeout_ms = 500;
  config.modbus.max_connections = 3;
  return config;
}

std::vector<Manners> draw_clients(Random& random, const BenchConfig& config) {
  const Time period = config.setup.period_ns;
  Manners viewer{.name = "viewer"};
  viewer.every = static_cast<std::uint32_t>(std::max<Time>(5 * kMillisecond / period, 1));
  viewer.read_every = 5 * kMillisecond;
  viewer.gets_all = true;
  viewer.gets_in = true;
  viewer.asks = 0.05;
  std::vector<Manners> clients{viewer, honest(random, period)};
  const std::uint64_t others = 1 + random.below(5);
  for (std::uint64_t i = 0; i < others; ++i) {
    switch (random.below(8)) {
      case 0:
        clients.push_back(sloppy(random, period));
        break;
      case 1:
        clients.push_back(fighter());
        break;
      case 2:
        clients.push_back(slow_reader());
        break;
      case 3:
        clients.push_back(babbler());
        break;
      case 4:
        clients.push_back(silent());
        break;
      case 5:
        clients.push_back(glutton());
        break;
      case 6:
        clients.push_back(leaver(random, period));
        break;
      default:
        clients.push_back(honest(random, period));
        break;
    }
  }
  if (!config.tcp.asks_for_token) return clients;
  for (Manners& client : clients)
    client.token = kAdminToken;
  clients.push_back(guest());
  if (random.chance(0.5)) clients.push_back(guesser());
  return clients;
}

}  // namespace drivebench::simulator
