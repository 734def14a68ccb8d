#pragma once

#include <dlfcn.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <variant>

#include "server/bench/bench.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/spsc_queue.hpp"
#include "tests/server/recording/run_config.hpp"

/// Shared by the tests under the preloaded guard.
namespace drivebench {

inline constexpr Tick kBatch =
    100;  // its samples and commands fit into the room that Recorder::wait_for_room() leaves

/// The functions of the preloaded guard.
struct Guard {
  template <class Function>
  static Function* find(const char* name) {
    auto* const found = reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
    if (found == nullptr)
      throw std::runtime_error(std::string(name) + " is not there: the guard is not preloaded");
    return found;
  }
  void (*begin)() = find<void()>("guard_begin");
  void (*end)() = find<void()>("guard_end");
  std::uint64_t (*hits)() = find<std::uint64_t()>("guard_hits");
  const char* (*first_hit)() = find<const char*()>("guard_first_hit");
};

/// The work of the threaded engine's tap: a copy into the recorder's queue, one into the queue to the I/O
/// thread.
class Tap : public BenchObserver {
 public:
  using Event = std::variant<Sample, Tick>;
  explicit Tap(Recorder* recorder) : recorder_(recorder) {}
  void on_input(Tick now, const Input& input) noexcept override {
    if (recorder_ != nullptr) recorder_->on_input(now, input);
  }
  void on_sample(std::uint32_t axis, const Sample& sample) noexcept override {
    if (recorder_ != nullptr) recorder_->on_sample(axis, sample);
    events.push(sample);
  }
  /// Outside the tick: the work of the threads behind the queues.
  void drain() {
    while (events.front() != nullptr)
      events.pop();
    if (recorder_ != nullptr) recorder_->wait_for_room();
  }

  SpscQueue<Event> events{4096};

 private:
  Recorder* recorder_;
};

/// Two axes, one of them with everything that takes time: noise, a converter, dry friction, loads, a turning
/// shaft.
inline BenchConfig busy_bench() {
  BenchConfig config = servo_bench(2);
  AxisParameters& second = config.setup.axes[1].parameters;
  second.mechanics.coulomb_friction_nm = 0.01;
  second.mechanics.static_friction_nm = 0.02;
  second.sensors.current.bits = 12;
  return config;
}

}  // namespace drivebench
