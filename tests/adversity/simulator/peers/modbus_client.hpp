#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "tests/adversity/simulator/world/scene.hpp"
#include "tests/adversity/simulator/world/wire.hpp"

namespace drivebench::simulator {

/// A Modbus client that reads, takes the lease, commands, and now and then sends invalid requests.
class ModbusClient final : public Player {
 public:
  /// `connect` gives the client's end of a new connection to the server.
  ModbusClient(Scene& scene, std::uint64_t number, std::function<int()> connect);

  void start() override { take_turn(); }
  void finish() override;
  void check_end() override;
  void leave() override;

 private:
  using Words = std::vector<std::uint16_t>;

  void take_turn();
  void act();
  bool may_be_heard() const;
  void read();
  void on_bytes(std::span<const std::byte> bytes);
  void ask(std::uint8_t function, std::initializer_list<std::size_t> words, const Words& data = {});
  void write(std::size_t address, const Words& data) { ask(16, {address, data.size()}, data); }
  Words command();

  Scene& scene_;
  std::uint64_t number_;
  Random random_;
  std::function<int()> connect_;
  std::shared_ptr<Wire> wire_;
  std::uint64_t connection_ = 0;
  std::uint32_t axis_;
  std::uint16_t transaction_ = 0;
  std::deque<std::uint16_t> asked_;  ///< transactions without an answer, in order
  std::vector<std::uint8_t> received_;
  bool raw_ = false;
  Time quiet_until_ = 0;  ///< sends nothing
};

}  // namespace drivebench::simulator
