#pragma once

#include <memory>

#include "protocols/can/codec.hpp"
#include "tests/adversity/simulator/world/scene.hpp"
#include "tests/server/endpoints/can/memory_bus.hpp"

namespace drivebench::simulator {

/// The control board of one axis on a CAN bus in memory, and the faults of that bus: frames get lost, doubled
/// and late, the queue is full, the wire breaks, the controller reports errors, and the board falls silent.
class CanDrive final : public Player {
 public:
  CanDrive(Scene& scene, can::MemoryWire& wire, const can::Profile& profile, std::uint32_t axis);

  void start() override { take_turn(); }
  void finish() override;
  void check_end() override;
  void leave() override;

 private:
  static constexpr std::uint64_t kMostLost = 50;

  void take_turn();
  void disturb();
  void on_frame(const can::Frame& frame);
  void on_reply(const can::MessageRow& row, const can::Values& values);
  void command(std::uint64_t tick);
  void request(can::Request request);
  void keep();
  bool is_monitored() const { return heartbeats_ > kMostLost; }
  void heartbeat(double state);
  void send(can::Message message, std::span<const double> values);

  Scene& scene_;
  Random random_;
  can::MemoryWire& wire_;
  can::Profile profile_;
  std::unique_ptr<can::Bus> bus_;
  std::uint32_t axis_;
  std::uint32_t node_;
  bool wide_;
  double commands_ = 0.0;         ///< share of the ticks that it answers
  Time sick_until_ = 0;           ///< without heartbeats
  std::uint64_t heartbeats_ = 0;  ///< since it got the lease, or the bus was disturbed
  Time dead_until_ = 0;           ///< sends nothing at all
  Tick commanded_ = -1;           ///< tick of its last command
  std::uint8_t lease_ = 0;
  bool latched_ = false;
  bool answered_ = false;  ///< since it began to finish
};

}  // namespace drivebench::simulator
