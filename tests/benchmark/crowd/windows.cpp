#include "tests/benchmark/crowd/windows.hpp"

#include <fmt/core.h>

#include <chrono>
#include <fstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/plan.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"

namespace drivebench::speed {
namespace {

using namespace std::chrono_literals;

constexpr auto kWindow = 2000ms;
constexpr int kRounds = 5;            // of windows of each kind, in turn
constexpr double kMaxMoreLate = 5.0;  // of 10,000 ticks: windows of one kind differ by as much

Window watch(link::Link& client) {
  const auto newest = [&client] { return client.exchange({}).front().sample; };
  const Sample first = newest();
  std::vector<double> us;
  const auto end = std::chrono::steady_clock::now() + planned(kWindow, 100ms);
  while (std::chrono::steady_clock::now() < end) {
    const std::int64_t begin = now_ns();
    newest();
    us.push_back(static_cast<double>(now_ns() - begin) * 1e-3);
    std::this_thread::sleep_for(2ms);
  }
  const Sample last = newest();
  return {.p99_us = percentile(us, 0.99),
          .ticks = static_cast<double>(last.tick - first.tick),
          .late_ticks = static_cast<double>(last.late_ticks - first.late_ticks)};
}

}  // namespace

double late_per_10000(const std::vector<Window>& windows) {
  return median(windows, [](const Window& each) { return 1e4 * each.late_ticks / each.ticks; });
}

Windows in_turn(link::Link& client, const std::string& here, const std::string& other, const Company& come) {
  constexpr auto kUntilTheyAreGone = 500ms;
  Windows windows;
  for (int round = 0; round < planned(kRounds, 1); ++round) {
    windows.alone.push_back(watch(client));
    {
      const auto company = come(here);
      windows.beside.push_back(watch(client));
    }
    std::this_thread::sleep_for(kUntilTheyAreGone);
    Server there({other});
    const auto company = come(there.address());
    windows.elsewhere.push_back(watch(client));
  }
  return windows;
}

Row late_ticks_row(const std::string& beside, const Windows& windows, const Disturbance& disturbance) {
  return {.name = "late ticks per 10,000 beside " + beside,
          .measured = late_per_10000(windows.beside),
          .floor = late_per_10000(windows.elsewhere),
          .limit = Limit{Limit::Kind::kExcessAtMost, kMaxMoreLate},
          .disturbance = disturbance,
          .note = fmt::format("floor: the same at another server on this machine; alone: {:.2f}",
                              late_per_10000(windows.alone))};
}

std::filesystem::path written(std::filesystem::path file, const std::string& text) {
  if (!(std::ofstream(file) << text)) throw std::runtime_error("cannot write " + file.string());
  return file;
}

}  // namespace drivebench::speed
