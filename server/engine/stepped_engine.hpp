#pragma once

#include <functional>
#include <memory>

#include "server/engine/engine.hpp"
#include "server/pacing/pacer.hpp"

namespace drivebench {

/// The engine of a real-time or free run without its thread: `tick` does what that does for each tick, and
/// the pacer says how late it is. The one who calls both may do so in a time of its own.
struct SteppedEngine {
  std::unique_ptr<Engine> engine;
  std::function<void()> tick;
};

SteppedEngine make_stepped_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                  boost::asio::io_context& io, std::unique_ptr<Pacer> pacer);

}  // namespace drivebench
