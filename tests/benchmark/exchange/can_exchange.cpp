#include <fmt/core.h>

#include <array>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>

#include "clients/command/common/programs/installation.hpp"
#include "protocols/can/codec.hpp"
#include "tests/benchmark/exchange/can_wire.hpp"
#include "tests/benchmark/harness/canary.hpp"
#include "tests/benchmark/harness/child.hpp"
#include "tests/benchmark/harness/server.hpp"
#include "tests/benchmark/harness/statistics.hpp"
#include "tests/benchmark/measurements.hpp"

namespace drivebench::speed::can_exchange {
namespace {

using can::Message;

constexpr double kMaxMulticastRatio = 1.5;
constexpr double kMaxSocketCanRatio = 1.3;
constexpr std::size_t kBlock = 1000;
constexpr std::size_t kRounds = 10;
constexpr std::uint32_t kNode = 1;
constexpr const char* kGroup = "239.74.163.2";
constexpr const char* kInterface = "vcan0";
constexpr const char* kFloorInterface = "vcan1";  // so that floor and bench do not hear each other
constexpr double kAcquire = 1.0;
constexpr double kVoltageMode = 1.0;

/// The datagrams of one tick: a command, and the bench's frames for it, SYNC last.
struct Datagrams {
  std::vector<std::byte> command;
  std::vector<std::vector<std::byte>> answers;
};

std::vector<std::byte> copy_of(Bytes bytes) {
  return {bytes.begin(), bytes.end()};
}

/// The controller's side of a lockstep run: the servo after a line start.
class Controller {
 public:
  Controller(CanWire wire, bool fd) : wire_(std::move(wire)) {
    profile_.fd = fd;
    acquire();
    for (std::size_t k = 0; k < 2 * kBlock; ++k)
      exchange();
  }

  void exchange() {
    wire_.send(wire_.datagram_of(command()));
    const std::uint32_t wanted = tick_ + 1;
    bool has_sample = false;
    while (tick_ != wanted) {
      const Message message = take(wire_.receive());
      has_sample = has_sample || message == Message::kSensors || message == Message::kCurrents;
    }
    if (!has_sample) throw std::runtime_error("a tick came without its sample");
  }

  /// One exchange on the bus, without the occasional frames.
  Datagrams datagrams() {
    Datagrams all{.command = copy_of(wire_.datagram_of(command())), .answers = {}};
    wire_.send(all.command);
    for (const std::uint32_t wanted = tick_ + 1; tick_ != wanted;) {
      const Bytes datagram = wire_.receive();
      switch (take(datagram)) {
        case Message::kSensors:
        case Message::kEncoder:
        case Message::kCurrents:
        case Message::kSync:
          all.answers.push_back(copy_of(datagram));
          break;
        default:
          break;
      }
    }
    return all;
  }

 private:
  can::Frame command() {
    const TwoPhase& u = line_voltages()[tick_ % line_voltages().size()];
    can::Values values{};
    const auto put = [&](std::size_t in_classic, std::size_t in_fd, double value) {
      values[profile_.fd ? in_fd : in_classic] = value;
    };
    constexpr auto field = [](bool fd, std::string_view name) {
      return can::index_of(Message::kCommand, fd, name);
    };
    put(field(false, "tick"), field(true, "tick"), tick_);
    put(field(false, "mode"), field(true, "mode"), kVoltageMode);
    put(field(false, "lease"), field(true, "lease"), lease_);
    put(field(false, "u_a"), field(true, "u_a"), u.a);
    put(field(false, "u_b"), field(true, "u_b"), u.b);
    return can::encode(*can::find_message(Message::kCommand, profile_.fd), profile_, kNode, values);
  }

  void acquire() {
    wire_.send(wire_.datagram_of(can::encode(*can::find_message(Message::kRequest, profile_.fd), profile_,
                                             kNode, std::array{kAcquire, 0.0, 4711.0})));
    while (lease_ == 0.0 || !has_sync_)
      take(wire_.receive());
  }

  Message take(Bytes datagram) {
    const std::optional<can::Frame> frame = wire_.frame_of(datagram);
    if (!frame) throw std::runtime_error("a datagram is no frame");
    const can::Match found = can::match(profile_, *frame);
    if (!found.ok()) throw std::runtime_error("a frame is not of the native profile");
    const can::Values values = can::decode(*found.row, profile_, *frame);
    switch (found.row->message) {
      case Message::kSync:
        has_sync_ = true;
        tick_ = static_cast<std::uint32_t>(values[can::index_of(Message::kSync, true, "tick")]);
        break;
      case Message::kReply:
        if (values[can::index_of(Message::kReply, true, "result")] != 0.0) {
          throw std::runtime_error("the bench refused a command or a request");
        }
        lease_ = values[can::index_of(Message::kReply, true, "lease")];
        break;
      default:
        can::update_sample(*found.row, values, sample_);
    }
    return found.row->message;
  }

  CanWire wire_;
  can::Profile profile_;
  Sample sample_;
  std::uint32_t tick_ = 0;
  double lease_ = 0.0;
  bool has_sync_ = false;
};

/// The floor: a process that answers each command with those datagrams, or another datagram with the first.
class PingPong {
 public:
  PingPong(const Datagrams& datagrams, std::pair<CanWire, CanWire> ends)
      : datagrams_(datagrams), other_(datagrams.command), near_(std::move(ends.first)), child_([&] {
          for (CanWire& far = ends.second;;) {
            const std::size_t wanted =
                far.receive().back() == datagrams_.command.back() ? datagrams_.answers.size() : 1;
            for (std::size_t i = 0; i < wanted; ++i)
              far.send(datagrams_.answers[i]);
          }
        }) {
    other_.back() ^= std::byte{1};
  }

  void exchange() {
    near_.send(datagrams_.command);
    for (std::size_t i = 0; i < datagrams_.answers.size(); ++i)
      near_.receive();
  }
  void exchange_one() {
    near_.send(other_);
    near_.receive();
  }

 private:
  Datagrams datagrams_;
  std::vector<std::byte> other_;
  CanWire near_;
  Child child_;
};

/// A bus as the bench and its controller see it, and a second one for the floor, so that they do not hear
/// each other.
struct Bus {
  std::string name;
  CanConfig config;
  std::function<CanWire()> open;
  std::function<std::pair<CanWire, CanWire>()> open_floor;
  double max_ratio;
};

struct Round {
  Percentiles floor, bench, one_answer;
  std::optional<Percentiles> unicast;
};

/// All processes that take turns.
struct Contest {
  explicit Contest(const Bus& bus) {
    const Pinned pinned(cpu_pair().far);  // the processes inherit it
    BenchConfig config = load_config(command::find_config("servo-can"));
    config.can = {bus.config};
    config.can[0].idle_timeout_ms = 0;  // for a slow guest too
    const std::filesystem::path file = folder / "bench.toml";
    if (!(std::ofstream(file) << to_toml(config))) throw std::runtime_error("cannot write " + file.string());
    server.emplace(std::vector<std::string>{file.string()});
    controller.emplace(bus.open(), bus.config.profile.fd);
    const Datagrams datagrams = controller->datagrams();
    floor.emplace(datagrams, bus.open_floor());
    if (bus.config.backend == can::Backend::kUdpMulticast) unicast.emplace(datagrams, CanWire::unicast());
    what = fmt::format("{} B out", datagrams.command.size());
    for (const auto& answer : datagrams.answers)
      what += fmt::format(", {} B", answer.size());
    what += " back";
  }

  Rounds<Round> run(CpuPair cpu) {
    const Pinned pinned(cpu.near);
    const std::array cpus{cpu.near, cpu.far};
    return undisturbed_rounds(cpus, kRounds, [&] {
      Round round{.floor = time_exchanges(kBlock, [&] { floor->exchange(); }),
                  .bench = time_exchanges(kBlock, [&] { controller->exchange(); }),
                  .one_answer = time_exchanges(kBlock, [&] { floor->exchange_one(); }),
                  .unicast = {}};
      if (unicast) round.unicast = time_exchanges(kBlock, [&] { unicast->exchange(); });
      return round;
    });
  }

  ScratchFolder folder;
  std::optional<Server> server;
  std::optional<Controller> controller;
  std::optional<PingPong> floor;
  std::optional<PingPong> unicast;
  std::string what;  ///< the datagrams of an exchange
};

Row row(std::string name, const Rounds<Round>& rounds, double Percentiles::*figure,
        std::optional<double> max) {
  Row row{.name = std::move(name),
          .unit = "us",
          .measured = median(rounds.results, [&](const Round& round) { return round.bench.*figure; }),
          .floor = median(rounds.results, [&](const Round& round) { return round.floor.*figure; }),
          .disturbance = rounds.disturbance};
  if (max) row.limit = Limit{Limit::Kind::kRatioAtMost, *max};
  return row;
}

std::vector<Row> measure_bus(const Bus& bus) {
  Contest contest(bus);
  const CpuPair cpu = cpu_pair();
  const Rounds<Round> across = contest.run(cpu);
  std::vector<Row> rows{row(bus.name + " p50", across, &Percentiles::p50, bus.max_ratio),
                        row(bus.name + " p99", across, &Percentiles::p99, {})};
  rows[0].note =
      fmt::format("floor: blocking ping-pong on such a bus, {}, {}; with the first answer alone {:.1f} us",
                  contest.what, cpu.near != cpu.far ? "across CPUs" : "on one CPU",
                  median(across.results, [](const Round& round) { return round.one_answer.p50; }));
  if (contest.unicast) {
    rows[0].note += fmt::format(", to the other end only {:.1f} us",
                                median(across.results, [](const Round& r) { return r.unicast->p50; }));
  }
  if (cpu.near == cpu.far) return rows;
  const Rounds<Round> same = contest.run({.near = cpu.far, .far = cpu.far});
  rows.push_back(row(bus.name + " p50, one CPU", same, &Percentiles::p50, bus.max_ratio));
  return rows;
}

std::vector<Row> in_both_profiles(const std::function<Bus(bool fd)>& bus_of) {
  std::vector<Row> rows = measure_bus(bus_of(true));
  for (Row& each : measure_bus(bus_of(false)))
    rows.push_back(std::move(each));
  return rows;
}

}  // namespace

std::vector<Row> measure_multicast() {
  return in_both_profiles([](bool fd) {
    Bus bus{.name = fd ? "udp_multicast, FD" : "udp_multicast, classic",
            .config = load_config(command::find_config("servo-can")).can.at(0),
            .open = {},
            .open_floor = {},
            .max_ratio = kMaxMulticastRatio};
    bus.config.backend = can::Backend::kUdpMulticast;
    bus.config.channel = kGroup;
    bus.config.port = free_udp_port();
    bus.config.profile.fd = fd;
    bus.open = [port = bus.config.port] { return CanWire::multicast(kGroup, port); };
    bus.open_floor = [] {
      const std::uint16_t port = free_udp_port();
      return std::pair(CanWire::multicast(kGroup, port), CanWire::multicast(kGroup, port));
    };
    return bus;
  });
}

std::vector<Row> measure_socketcan() {
  if (!has_can(kInterface) || !has_can(kFloorInterface)) {
    // taskset, because user-mode Linux is several processes of the host: on several CPUs they wait for each
    // other's, and the ratio goes from 0.85 to 1.5.
    return {{.name = "socketcan",
             .note = "this kernel has no vcan0 and vcan1; taskset -c 0 tests/tools/can-vm -t 300 -- "
                     "build/release/bin/drivebench-benchmark --only socketcan",
             .skipped = true}};
  }
  return in_both_profiles([](bool fd) {
    Bus bus{.name = fd ? "socketcan, FD" : "socketcan, classic",
            .config = load_config(command::find_config("servo-can")).can.at(0),
            .open = [] { return CanWire::socketcan(kInterface); },
            .open_floor =
                [] {
                  return std::pair(CanWire::socketcan(kFloorInterface), CanWire::socketcan(kFloorInterface));
                },
            .max_ratio = kMaxSocketCanRatio};
    bus.config.backend = can::Backend::kSocketCan;
    bus.config.channel = kInterface;
    bus.config.profile.fd = fd;
    return bus;
  });
}

}  // namespace drivebench::speed::can_exchange
