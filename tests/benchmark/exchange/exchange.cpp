#include <arpa/inet.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <array>
#include <memory>
#include <optional>
#include <stdexcept>

#include "clients/command/common/programs/installation.hpp"
#include "clients/link/common/address.hpp"
#include "tests/benchmark/exchange/controller.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/child.hpp"
#include "tests/benchmark/harness/machine.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::exchange {
namespace {

constexpr double kMaxP50Ratio = 1.25;
constexpr double kMaxP99Ratio = 1.5;
constexpr std::size_t kRounds = 10;

bool receive_all(int socket, std::span<std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t got = ::recv(socket, bytes.data(), bytes.size(), 0);
    if (got <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(got));
  }
  return true;
}

bool send_all(int socket, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
  return true;
}

/// The floor: a process that answers every request of a given size with a reply of a given size, over TCP
/// with blocking calls and nothing in between.
class PingPong {
 public:
  explicit PingPong(Sizes sizes) : request_(sizes.request), reply_(sizes.reply) {
    const link::FileDescriptor listener(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    check(::bind(listener.get(), generic, size) == 0 && ::listen(listener.get(), 1) == 0, "listen");
    check(::getsockname(listener.get(), generic, &size) == 0, "getsockname");
    child_.emplace([&] { answer(listener.get()); });
    socket_ =
        link::connect_to({.host = "127.0.0.1", .port = std::to_string(ntohs(address.sin_port)), .path = {}},
                         std::chrono::seconds(5));
  }

  void exchange() {
    if (!send_all(socket_.get(), request_) || !receive_all(socket_.get(), reply_)) {
      throw std::runtime_error("the ping-pong ended early");
    }
  }

 private:
  void answer(int listener) {
    const int socket = ::accept(listener, nullptr, nullptr);
    const int on = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    while (receive_all(socket, request_) && send_all(socket, reply_)) {
    }
  }

  std::vector<std::byte> request_;
  std::vector<std::byte> reply_;
  std::optional<Child> child_;
  link::FileDescriptor socket_;
};

struct Round {
  Percentiles floor, tcp, unix_socket;
};

/// A controller and a server of its own that both look for the other's word before they sleep.
Row measure_looking(const std::string& bench, PingPong& floor, CpuPair cpu) {
  auto far = std::make_unique<Pinned>(cpu.far);
  Server server({bench, "--spin-us", "200"});
  far.reset();
  const Pinned near(cpu.near);
  Controller controller(server.address() + "?spin_us=200");
  struct Looked {
    Percentiles floor, looking;
  };
  const std::array cpus{cpu.near, cpu.far};
  const auto rounds = undisturbed_rounds(cpus, kRounds, [&]() -> Looked {
    return {.floor = time_exchanges(kBlock, [&] { floor.exchange(); }),
            .looking = time_exchanges(kBlock, [&] { controller.exchange(); })};
  });
  return {.name = "exchange tcp p50, both look before they sleep",
          .unit = "us",
          .measured = median(rounds.results, [](const Looked& round) { return round.looking.p50; }),
          .floor = median(rounds.results, [](const Looked& round) { return round.floor.p50; }),
          .disturbance = rounds.disturbance,
          .note = "--spin-us 200 and ?spin_us=200; the floor sleeps"};
}

Rounds<Round> alternate(Controller& tcp, Controller& unix_socket, PingPong& floor, CpuPair cpu) {
  const Pinned pinned(cpu.near);
  const std::array cpus{cpu.near, cpu.far};
  return undisturbed_rounds(cpus, kRounds, [&]() -> Round {
    return {.floor = time_exchanges(kBlock, [&] { floor.exchange(); }),
            .tcp = time_exchanges(kBlock, [&] { tcp.exchange(); }),
            .unix_socket = time_exchanges(kBlock, [&] { unix_socket.exchange(); })};
  });
}

/// One figure of one link beside the same figure of the floor.
Row row(const std::string& name, const Rounds<Round>& rounds, Percentiles Round::*link,
        double Percentiles::*figure, std::optional<double> max_ratio, std::string note = {}) {
  const auto figure_of = [figure](Percentiles Round::*each) {
    return [each, figure](const Round& round) { return round.*each.*figure; };
  };
  Row row{.name = name,
          .unit = "us",
          .measured = median(rounds.results, figure_of(link)),
          .floor = median(rounds.results, figure_of(&Round::floor)),
          .disturbance = rounds.disturbance,
          .note = std::move(note)};
  if (max_ratio) row.limit = Limit{Limit::Kind::kRatioAtMost, *max_ratio};
  return row;
}

}  // namespace

std::vector<Row> measure() {
  const CpuPair cpu = cpu_pair();
  const ScratchFolder folder;
  const std::string bench = command::find_config("servo").string();
  const std::string path = folder / "bench.socket";

  // Started while pinned, which they inherit. Two servers, since an axis has one controller.
  auto pinned = std::make_unique<Pinned>(cpu.far);
  Server tcp_server({bench});
  Server unix_server({bench, "--unix", path});
  Controller tcp(tcp_server.address());
  Controller unix_socket("unix:" + path);
  const Sizes sizes = tcp.sizes();
  PingPong floor(sizes);
  pinned.reset();

  const Rounds<Round> across = alternate(tcp, unix_socket, floor, cpu);
  const Rounds<Round> same = alternate(tcp, unix_socket, floor, {.near = cpu.far, .far = cpu.far});
  const std::string floor_note =
      fmt::format("floor: blocking TCP ping-pong of {} and {} bytes, {}", sizes.request, sizes.reply,
                  cpu.near != cpu.far ? "across CPUs" : "on one CPU");
  constexpr auto kTcp = &Round::tcp;
  constexpr auto kUnix = &Round::unix_socket;
  constexpr auto kP50 = &Percentiles::p50;
  constexpr auto kP99 = &Percentiles::p99;
  return {row("exchange tcp p50", across, kTcp, kP50, kMaxP50Ratio, floor_note),
          row("exchange tcp p99", across, kTcp, kP99, kMaxP99Ratio),
          row("exchange unix p50", across, kUnix, kP50, {}, "the floor is that of TCP"),
          row("exchange unix p99", across, kUnix, kP99, {}),
          measure_looking(bench, floor, cpu),
          row("exchange tcp p50, one CPU", same, kTcp, kP50, {}, "both ends pinned to one CPU"),
          row("exchange unix p50, one CPU", same, kUnix, kP50, {})};
}

}  // namespace drivebench::speed::exchange
