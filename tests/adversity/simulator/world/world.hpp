#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/access/audit.hpp"
#include "server/endpoints/can/endpoint.hpp"
#include "server/endpoints/modbus/modbus_server.hpp"
#include "server/endpoints/tcp/stream_server.hpp"
#include "server/host/asio.hpp"
#include "server/pacing/pacer.hpp"
#include "tests/adversity/simulator/world/disk.hpp"
#include "tests/adversity/simulator/world/scene.hpp"
#include "tests/server/endpoints/can/memory_bus.hpp"

namespace drivebench::simulator {

/// The result of a seed.
struct Outcome {
  std::uint64_t seed = 0;
  std::uint64_t ticks = 0;
  std::uint64_t events = 0;
  std::uint64_t hash = 0;  ///< of all events and of the last state
  std::string bench;
  std::string players;
  Scene::Failure failure;
  std::string tail;  ///< the last events
};

/// One server and its surroundings, in one thread and in virtual time.
class World {
 public:
  World(std::uint64_t seed, bool prints, const std::string& folder);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  Outcome run(Time duration);

 private:
  class VirtualPacer;

  void make_engine();
  std::unique_ptr<Recorder> make_recorder();
  void record();
  void check_recording(const Verdict& verdict);
  void check_audit();
  void open_transports();
  void cast();
  int connect_modbus();
  void tick();
  void on_tick();
  void disturb();
  void turn_clock();
  void poll();
  void pulse();
  void play_until(Time end);
  void finish();

  std::uint64_t seed_;
  Scene scene_;
  BenchConfig config_;
  asio::io_context io_{1};
  std::unique_ptr<StreamServer> server_;
  std::unique_ptr<ModbusServer> modbus_;  ///< of benches with Modbus
  std::unique_ptr<can::MemoryWire> bus_;
  std::unique_ptr<can::Endpoint> can_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<Audit> audit_;  ///< of benches with tokens
  Recorder* recorder_ = nullptr;  ///< of the engine; null: this seed records nothing
  std::function<void()> tick_;
  VirtualPacer* pacer_ = nullptr;
  std::unique_ptr<ServerTimer> waker_;  ///< makes Asio look at its timers
  std::vector<std::unique_ptr<Player>> players_;
  std::string names_;
  std::unique_ptr<FakeDisk> disk_;
  bool disk_stalled_ = false;  ///< at least once
  Time due_ = 0;               ///< of the next tick
  Time host_free_at_ = 0;
  Time io_free_at_ = 0;
  Time io_every_ = 0;  ///< shortest time between its turns
  Time io_next_ = 0;
  Time clock_next_ = 0;  ///< next step of the server's clock
  std::uint64_t late_ticks_ = 0;
  std::vector<std::uint64_t> late_until_{0};  ///< late ticks before a sample, by its tick
  std::int64_t ticks_ = 0;
};

}  // namespace drivebench::simulator
