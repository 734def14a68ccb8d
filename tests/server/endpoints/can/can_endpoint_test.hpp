#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "protocols/can/command.hpp"
#include "server/endpoints/can/endpoint.hpp"
#include "server/host/asio.hpp"
#include "tests/server/endpoints/can/memory_bus.hpp"
#include "tests/server/recording/run_config.hpp"

namespace drivebench::can {

/// A message that came in, by field.
struct Received {
  const MessageRow* row;
  std::uint32_t node;
  Values values;
  Frame frame;

  double operator[](std::string_view field) const { return values[index_of(*row, field)]; }
};

/// A bench that sends all its messages often.
inline BenchConfig on_bus(BenchConfig bench, Profile profile) {
  CanConfig can;
  can.profile = profile;
  can.edges = profile.fd;
  can.state_every_ticks = 4;
  can.heartbeat_ms = 10;
  can.controller_timeout_ms = 30;
  bench.can.push_back(can);
  return bench;
}

/// A lockstep bench on a bus in memory, and a controller on the same bus that the test speaks for.
class CanBench {
 public:
  explicit CanBench(Profile profile = {}, std::size_t axes = 1) { setup(on_bus(servo_bench(axes), profile)); }
  explicit CanBench(const BenchConfig& bench, Audit* audit = nullptr) { setup(bench, audit); }

  /// Lets everything happen that needs no waiting.
  void settle() {
    io_.restart();
    io_.poll();
  }
  /// Waits for a message, whatever time that takes; for things that a timer does.
  Received wait_for(Message message) {
    for (;;) {
      if (const auto found = newest(message)) return *found;
      wait();
    }
  }
  /// Waits until something happens.
  void wait() {
    io_.restart();
    io_.run_one();
  }

  void send(Message message, std::span<const double> values, std::uint32_t node = 1) {
    controller_->send(encode(*find_message(message, profile_.fd, is_wide(node)), profile_, node, values));
    settle();
  }
  void send(const Frame& frame) {
    controller_->send(frame);
    settle();
  }
  void request(Request request, std::uint8_t lease = 0, std::uint32_t controller = 77,
               std::uint32_t node = 1) {
    received.clear();
    send(
        Message::kRequest,
        std::array{static_cast<double>(request), static_cast<double>(lease), static_cast<double>(controller)},
        node);
  }
  /// The lease number; 0 if refused.
  std::uint8_t acquire(std::uint32_t controller = 77, std::uint32_t node = 1) {
    request(Request::kAcquire, 0, controller, node);
    const auto reply = newest(Message::kReply);
    return reply && (*reply)["result"] == 0.0 ? static_cast<std::uint8_t>((*reply)["lease"])
                                              : std::uint8_t{0};
  }
  /// `answers` may be any number: its low bits go out.
  void command(double answers, double u_a, double u_b, std::uint8_t lease, double mode = 1.0,
               std::uint32_t node = 1) {
    command({.tick = static_cast<std::uint64_t>(static_cast<std::int64_t>(answers)),
             .mode = static_cast<unsigned>(mode),
             .lease = lease,
             .a = u_a,
             .b = u_b},
            node);
  }
  void command(const CommandFields& setpoints, std::uint32_t node = 1) {
    received.clear();
    for (const Frame& frame : encode_command(profile_, node, is_wide(node), setpoints))
      controller_->send(frame);
    settle();
  }
  std::optional<Received> newest(Message message, std::uint32_t node = 1) const {
    for (auto it = received.rbegin(); it != received.rend(); ++it) {
      if (it->row->message == message && (!it->row->per_node || it->node == node)) return *it;
    }
    return std::nullopt;
  }
  /// `result` of the newest reply; -1: there was none.
  double result() const {
    const auto reply = newest(Message::kReply);
    return reply ? (*reply)["result"] : -1.0;
  }
  std::uint64_t count(std::string_view name) const {
    for (const auto& [key, value] : endpoint_->report().counts) {
      if (key == name) return value;
    }
    ADD_FAILURE() << "no count " << name;
    return 0;
  }

  bool is_wide(std::uint32_t node) const { return terminals_of(engine_->parameters(node - 1)).is_wide(); }
  Engine& engine() { return *engine_; }
  Endpoint& endpoint() { return *endpoint_; }
  MemoryWire& wire() { return wire_; }
  asio::io_context& io() { return io_; }
  const Profile& profile() const { return profile_; }

  std::vector<Received> received;

 private:
  void setup(const BenchConfig& bench, Audit* audit = nullptr) {
    profile_ = bench.can.front().profile;
    for (const AxisSetup& axis : bench.setup.axes)
      profile_.wide |= terminals_of(axis.parameters).is_wide();
    controller_ = wire_.connect("controller");
    controller_->on_frame = [this](const Frame& frame, std::int64_t) {
      const Match found = match(profile_, frame);
      ASSERT_TRUE(found.ok()) << name_of(found.problem);
      received.push_back({found.row, found.node, decode(*found.row, profile_, frame), frame});
    };
    engine_ = make_lockstep_engine(bench);
    if (audit != nullptr) audit->watch(*engine_);
    endpoint_ = std::make_unique<Endpoint>(io_, bench.can.front(), wire_.connect("bench"));
    endpoint_->serve(*engine_, audit);
    settle();
  }

  asio::io_context io_{1};
  MemoryWire wire_{io_};
  Profile profile_;
  std::unique_ptr<Bus> controller_;
  std::unique_ptr<Endpoint> endpoint_;
  std::unique_ptr<Engine> engine_;
};

inline Profile classic() {
  Profile profile;
  profile.fd = false;
  return profile;
}

}  // namespace drivebench::can
