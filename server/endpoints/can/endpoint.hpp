#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/can/command.hpp"
#include "server/access/audit.hpp"
#include "server/access/seat.hpp"
#include "server/bench/terminals.hpp"
#include "server/endpoints/can/buses/bus.hpp"
#include "server/endpoints/can/conflict.hpp"
#include "server/endpoints/log_limit.hpp"
#include "server/endpoints/transport_report.hpp"
#include "server/engine/engine.hpp"
#include "server/host/asio.hpp"

namespace drivebench::can {

/// As people read it: "up" to "CAN_ABSENT".
std::string_view name_of(BusState state) noexcept;

/// The native profile on one bus: sends samples, state and heartbeats of every axis, and lets one controller
/// at a time command each axis. A controller shows its right with the lease number that the bench gave it. No
/// frame can do more than a session over TCP.
class Endpoint {
 public:
  Endpoint(asio::io_context& io, const CanConfig& config, std::unique_ptr<Bus> bus);

  /// Starts to listen and to send: boot-up first. `audit` may be null.
  void serve(Engine& engine, Audit* audit = nullptr);
  TransportReport report() const;
  std::string name() const { return bus_->name(); }
  /// Puts a frame of a [[message]] on the bus. Returns why it cannot; empty: it has.
  std::string send_frame(const Frame& frame);
  /// Sends that it stops, and nothing afterwards. The engine takes the leases back.
  void close();

 private:
  using Clock = ServerClock;

  // States of a heartbeat.
  static constexpr double kBootUp = 0.0;
  static constexpr double kStopped = 4.0;
  static constexpr double kOperational = 5.0;

  /// The set-points of phase c and the field, which wait for the command of their tick.
  struct PhaseSetpoints {
    Tick answers = -1;
    unsigned mode = 0;
    double c = 0.0;
    double field = 0.0;
  };

  /// An axis on this bus.
  struct Node {
    std::uint32_t axis = 0;
    std::uint32_t id = 0;
    Terminals terminals{};
    Seat seat;               ///< of the controller on this bus
    std::uint8_t lease = 0;  ///< its lease number; 0 while the seat is empty
    std::uint8_t last_lease = 0;
    std::uint32_t controller = 0;  ///< the number that the controller has chosen
    bool monitored = false;        ///< the controller sends heartbeats
    bool spoke = false;            ///< the controller has commanded since the last timer
    Tick commanded_at = -1;        ///< tick in which the bench took its newest command
    bool waits = false;            ///< at the last timer the controller had commanded the present tick
    PhaseSetpoints phases{};       ///< from the controller
    std::uint64_t faults = 0;      ///< last sent
    std::uint64_t injected = 0;    ///< last sent
    std::int64_t index_tick = -1;
    std::int64_t edges_tick = -1;
    std::optional<Sample> due{};  ///< a sample that is to be sent
    Conflict conflict{};

    bool wide() const noexcept { return terminals.is_wide(); }
  };

  void on_frame(const Frame& frame, std::int64_t stamp_ns);
  void on_command(Node& node, const MessageRow& row, const Values& values);
  void on_phase_command(Node& node, const MessageRow& row, const Values& values);
  void on_request(Node& node, const Values& values);
  void on_heartbeat(Node& node, const Values& values);
  void on_state();
  Client client_of(std::uint32_t controller) const;
  void acquire(Node& node, std::uint32_t controller);
  void on_acquired(Node& node, std::uint32_t controller, Refused refused, Tick tick);
  void act(Node& node, Request request, std::uint32_t controller);
  bool is_for(const Node& node, const MessageRow& row);
  Tick answered_by(const Node& node, const MessageRow& row, const CommandFields& given) const;
  /// Refuses a command before it reaches the bench, which counts it if the owner sent it.
  void refuse(const Node& node, Owner sender, Refused refused, const CommandFields& given,
              std::string_view why = {});
  /// Refuses a request before it reaches the bench.
  void turn_away(const Node& node, Request request, std::uint32_t controller, Refused refused,
                 std::string_view why = {});
  void note_client(const std::string& peer, std::string_view why);
  void log_refusal(const Node& node, std::string_view what, std::string_view why);
  void log_loss(const Node& node, std::string_view why);
  void lose(Node& node, const char* why);
  void note_conflict(const Frame& frame, Node* node);
  void fall_silent(Node& node, Clock::time_point now);
  void look_at_conflicts(Clock::time_point now);
  bool has_conflict() const;

  void on_set_back();
  void on_tick();
  void on_newest();
  void on_timer();
  void arm_timer();
  void look_after(Node& node, Clock::time_point now);
  void notice_end(Node& node);

  bool lockstep() const { return engine_->config().mode == RunMode::kLockstep; }
  Node* find_node(std::uint32_t id);
  void put(const Node& node, const Frame& frame);
  void put(const Frame& frame);
  void send(Message message, const Node& node, std::span<const double> values);
  void send_sample(Message message, const Node& node, const Sample& sample, Page page = Page{});
  void send_sensors(Node& node, const Sample& sample);
  void send_state(const Node& node, const Sample& sample);
  void send_changes(Node& node, const Sample& sample);
  void send_edges(Node& node);
  void send_sync(std::uint64_t tick);
  void send_heartbeat(const Node& node, double state);
  void reply(const Node& node, Request request, Refused refused, std::uint32_t controller, std::uint8_t lease,
             std::int64_t tick);

  ServerTimer timer_;
  CanConfig config_;
  std::unique_ptr<Bus> bus_;
  Engine* engine_ = nullptr;
  Audit* audit_ = nullptr;
  std::vector<Node> nodes_;
  std::vector<Frame> together_;  ///< frames of one tick, to be sent in one go
  bool collecting_ = false;
  Conflict sync_conflict_;
  Clock::time_point next_heartbeat_{};
  bool closed_ = false;
  BusState last_state_ = BusState::kAbsent;
  std::array<std::uint64_t, kFrameProblems> problems_{};
  std::uint64_t commands_ = 0;
  std::uint64_t refused_ = 0;      ///< commands and requests
  std::uint64_t not_owner_ = 0;    ///< of these, those without the lease, which are no part of the run
  std::uint64_t turned_away_ = 0;  ///< clients of the bus that were refused or cut off
  std::uint64_t conflicts_ = 0;
  std::uint64_t heartbeats_lost_ = 0;
  bool measure_latency_ = false;  ///< on the next frame that has a stamp
  std::int64_t latency_ns_ = 0;   ///< from the kernel's stamp to on_frame(), the newest
  std::int64_t worst_latency_ns_ = 0;
  LogLimit refusal_log_;
  LogLimit loss_log_;
  LogLimit conflict_log_;
  LogLimit state_log_;
};

}  // namespace drivebench::can
