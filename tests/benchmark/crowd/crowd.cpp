#include <fmt/core.h>
#include <sys/resource.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "tests/benchmark/crowd/viewers.hpp"
#include "tests/benchmark/crowd/windows.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::crowd {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kIdle = 1000;
constexpr int kSubscribers = 32;
constexpr std::uint32_t kEighth = 8;  // 1 kHz
constexpr std::size_t kDeaf = 50;
constexpr double kMaxP99Ratio = 2.0;
constexpr double kMaxGrowthMiB = 60.0;
constexpr double kMaxCut_s = 3.0;

/// Clients that say hello and then nothing.
using Idlers = std::vector<std::unique_ptr<link::Link>>;

Idlers idlers(const std::string& address, std::size_t count) {
  Idlers all;
  while (all.size() < count)
    all.push_back(std::make_unique<link::Link>(address));
  return all;
}

/// Clients that ask for every sample and read none.
Idlers deaf(const std::string& address) {
  Idlers all = idlers(address, kDeaf);
  for (const auto& each : all)
    each->subscribe(0, 1);
  return all;
}

void add_rows(std::vector<Row>& rows, const std::string& beside, const Windows& windows,
              const Disturbance& disturbance) {
  rows.push_back({.name = "p99 of a healthy client beside " + beside,
                  .unit = "us",
                  .measured = median(windows.beside, &Window::p99_us),
                  .floor = median(windows.alone, &Window::p99_us),
                  .limit = Limit{Limit::Kind::kRatioAtMost, kMaxP99Ratio},
                  .disturbance = disturbance,
                  .note = "floor: alone, in windows in turn"});
  rows.push_back(late_ticks_row(beside, windows, disturbance));
}

/// Both ends of all connections belong to this process or its child.
void allow_descriptors(rlim_t count) {
  rlimit limit{};
  check(::getrlimit(RLIMIT_NOFILE, &limit) == 0, "getrlimit");
  limit.rlim_cur = std::min(std::max(limit.rlim_cur, count), limit.rlim_max);
  check(::setrlimit(RLIMIT_NOFILE, &limit) == 0, "setrlimit");
}

void expect_full(const std::string& address) {
  try {
    const link::Link one_more(address);
  } catch (const link::RefusalError& refused) {
    return;  // refused with a reason
  }
  throw std::runtime_error("a session beyond max_sessions was taken");
}

/// The time until the server has cut the clients that do not read, and its memory meanwhile.
struct Cut {
  double elapsed_s = 0.0;
  double growth_mib = 0.0;
};

Cut cut_deaf(link::Link& client, const std::string& address, pid_t server) {
  const std::uint32_t before = client.status().sessions();
  Cut cut;
  const double baseline_mib = resident_mib(server);
  const Idlers company = deaf(address);
  const std::int64_t begin = now_ns();
  while (client.status().sessions() > before && cut.elapsed_s < 30.0) {
    cut.growth_mib = std::max(cut.growth_mib, resident_mib(server) - baseline_mib);
    std::this_thread::sleep_for(20ms);
    cut.elapsed_s = static_cast<double>(now_ns() - begin) * 1e-9;
  }
  return cut;
}

}  // namespace

std::vector<Row> measure() {
  allow_descriptors(4096);
  const ScratchFolder folder;
  BenchConfig config = bench_config("servo-realtime");
  config.tcp.max_sessions = kIdle + kSubscribers + 1;
  config.tcp.unix_path = (folder / "bench.socket").string();
  const std::filesystem::path bench = written(folder / "bench.toml", to_toml(config));
  // This server's ticks shall cost nothing, only its clients.
  config.tcp.max_sessions = kIdle + kSubscribers;
  config.tcp.unix_path = (folder / "other.socket").string();
  config.realtime.pacer = PacerKind::kSleep;
  config.realtime.priority = 1;
  const std::string other = written(folder / "other.toml", to_toml(config)).string();

  Canary canary;
  const CpuPair cpu = cpu_pair();
  canary.look(std::array{cpu.near, cpu.far});
  Server server({bench.string()});
  const pid_t pid = listener_of((folder / "bench.socket").string());
  auto client = std::make_unique<link::Link>(server.address());

  const Cut cut = cut_deaf(*client, server.address(), pid);
  struct Crowd {
    Idlers idle;
    std::unique_ptr<Viewers> subscribers;
  };
  const Windows crowded = in_turn(*client, server.address(), other, [](const std::string& place) {
    auto crowd = std::make_shared<Crowd>();
    crowd->idle = idlers(place, kIdle);
    crowd->subscribers = std::make_unique<Viewers>(place, kSubscribers);
    // Before a sample is sent: a viewer that a busy machine keeps from reading is cut off.
    expect_full(place);
    crowd->subscribers->watch(kEighth);
    return crowd;
  });
  const Windows unheard = in_turn(*client, server.address(), other, [](const std::string& place) {
    return std::make_shared<Idlers>(deaf(place));
  });
  client.reset();
  server.stop();
  canary.look(std::array{cpu.near, cpu.far});

  std::vector<Row> rows;
  add_rows(rows, "1,000 idle ones and 32 viewers at 1 kHz", crowded, canary.seen());
  add_rows(rows, "50 that never read", unheard, canary.seen());
  rows.push_back({.name = "until 50 that never read are cut off",
                  .unit = "s",
                  .measured = cut.elapsed_s,
                  .limit = Limit{Limit::Kind::kAtMost, kMaxCut_s},
                  .disturbance = canary.seen()});
  rows.push_back({.name = "memory that they cost",
                  .unit = "MiB",
                  .measured = cut.growth_mib,
                  .limit = Limit{Limit::Kind::kAtMost, kMaxGrowthMiB}});
  return rows;
}

}  // namespace drivebench::speed::crowd
