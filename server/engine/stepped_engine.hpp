#pragma once

#include <functional>
#include <memory>

#include "server/engine/engine.hpp"
#include "server/pacing/pacer.hpp"

namespace drivebench {

/// The engine of a real-time or free run without its thread: the caller runs each tick with `tick`, and the
/// pacer says how late it is. So a test can run it in virtual time.
struct SteppedEngine {
  std::unique_ptr<Engine> engine;
  std::function<void()> tick;
};

SteppedEngine make_stepped_engine(const BenchConfig& config, std::unique_ptr<Recorder> recorder,
                                  boost::asio::io_context& io, std::unique_ptr<Pacer> pacer);

}  // namespace drivebench
