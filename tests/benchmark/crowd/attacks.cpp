#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "tests/benchmark/crowd/attackers.hpp"
#include "tests/benchmark/crowd/viewers.hpp"
#include "tests/benchmark/crowd/windows.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::attacks {
namespace {

constexpr double kMaxResidentMiB = 128.0;
constexpr const char* kOwner = "the token of the owner";
constexpr const char* kGuest = "the token of a guest";

/// A bench file with tokens and an audit log of its own.
std::filesystem::path guarded_bench(const ScratchFolder& folder, const std::string& name,
                                    BenchConfig config) {
  const std::filesystem::path tokens =
      written(folder / (name + ".tokens"),
              std::string("[[token]]\nname = \"owner\"\nrole = \"admin\"\ntoken = \"") + kOwner +
                  "\"\n[[token]]\nname = \"guest\"\nrole = \"viewer\"\ntoken = \"" + kGuest + "\"\n");
  std::filesystem::permissions(tokens, std::filesystem::perms::owner_read);
  config.tcp.unix_path = (folder / (name + ".socket")).string();
  std::string text = to_toml(config);
  const std::string section = "[tcp]\n";
  text.insert(text.find(section) + section.size(), "tokens_file = \"" + tokens.string() + "\"\n");
  text += "\n[audit]\nfile = \"" + (folder / (name + ".audit")).string() + "\"\n[log]\nlevel = \"error\"\n";
  return written(folder / (name + ".toml"), text);
}

struct Attack {
  const char* name;
  Attackers::Round (*round)(const std::string& address);
};

constexpr std::array kAttacks = std::to_array<Attack>({
    {"64 sessions that send frames of 64 KiB",
     [](const std::string& address) { return large_frames(address, kGuest); }},
    {"100 silent connections, renewed", crowd_at_the_door},
    {"64 clients that guess tokens", wrong_tokens},
    {"64 sessions that ask for what is forbidden",
     [](const std::string& address) { return forbidden_requests(address, kGuest); }},
});

}  // namespace

std::vector<Row> measure() {
  const ScratchFolder folder;
  BenchConfig config = bench_config("servo-realtime");
  const std::string bench = guarded_bench(folder, "bench", config).string();
  // This server's ticks shall cost nothing, only its clients.
  config.realtime.pacer = PacerKind::kSleep;
  config.realtime.priority = 1;
  const std::string other = guarded_bench(folder, "other", config).string();

  Canary canary;
  const CpuPair cpu = cpu_pair();
  canary.look(std::array{cpu.near, cpu.far});
  Server server({bench});
  const pid_t pid = listener_of((folder / "bench.socket").string());
  link::Link client(server.address(), {.token = kOwner});
  std::vector<Windows> windows;
  double most_mib = 0.0;
  for (const Attack& attack : kAttacks) {
    windows.push_back(in_turn(client, server.address(), other, [&attack](const std::string& address) {
      return std::make_shared<Attackers>(attack.round(address));
    }));
    most_mib = std::max(most_mib, resident_mib(pid));
  }
  server.stop();
  canary.look(std::array{cpu.near, cpu.far});

  std::vector<Row> rows;
  for (std::size_t n = 0; n < kAttacks.size(); ++n) {
    rows.push_back(late_ticks_row(kAttacks[n].name, windows[n], canary.seen()));
    rows.push_back({.name = std::string("p99 of a healthy client beside ") + kAttacks[n].name,
                    .unit = "us",
                    .measured = median(windows[n].beside, &Window::p99_us),
                    .floor = median(windows[n].alone, &Window::p99_us),
                    .disturbance = canary.seen(),
                    .note = "floor: alone, in windows in turn"});
  }
  rows.push_back({.name = "resident memory of the server after each of them",
                  .unit = "MiB",
                  .measured = most_mib,
                  .limit = Limit{Limit::Kind::kAtMost, kMaxResidentMiB}});
  return rows;
}

}  // namespace drivebench::speed::attacks
