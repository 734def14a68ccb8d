#pragma once

#include <cstddef>
#include <vector>

#include "tests/adversity/simulator/world/scene.hpp"

namespace drivebench::simulator {

/// Connections that say nothing; each is renewed soon after the server has closed it.
class Crowd final : public Player {
 public:
  explicit Crowd(Scene& scene);
  ~Crowd() override { leave(); }
  Crowd(const Crowd&) = delete;
  Crowd& operator=(const Crowd&) = delete;

  void start() override { take_turn(); }
  void finish() override { leave(); }
  void check_end() override {}
  void leave() override;

 private:
  void take_turn();

  Scene& scene_;
  Random random_;
  std::vector<int> sockets_;  ///< -1: not connected
};

}  // namespace drivebench::simulator
