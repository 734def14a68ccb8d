#pragma once

#include <cstdint>
#include <utility>
#include <variant>

#include "server/engine/tick_edges.hpp"
#include "server/recording/recorder.hpp"
#include "server/recording/spsc_queue.hpp"

namespace drivebench {

/// The answer of the bench to a request.
struct RequestOutcome {
  Refused refused;
  Tick tick;
};
struct AxisEdges {
  AxisEdges(std::uint32_t of, const TickEdges& seen) noexcept : axis(of), edges(seen) {}
  std::uint32_t axis;
  TickEdges edges;
};
/// The run has ended.
struct RunEnded {};
/// A message from the tick thread to the I/O thread.
using TickEvent = std::variant<TickedSample, RequestOutcome, AxisEdges, RunEnded>;

/// Passes inputs to the recorder, and samples to the recorder and the I/O thread.
class TickTap final : public BenchObserver {
 public:
  TickTap(Recorder* recorder, SpscQueue<TickEvent>& events) : recorder_(recorder), events_(events) {}
  void on_input(Tick now, const Input& input) noexcept override {
    if (recorder_ != nullptr) recorder_->on_input(now, input);
  }
  void on_sample(std::uint32_t axis, const Sample& sample) noexcept override {
    if (recorder_ != nullptr) recorder_->on_sample(axis, sample);
    if (bench_ != nullptr) events_.emplace(std::in_place_type<AxisEdges>, axis, edges_of(*bench_, axis));
    // With a full queue viewers lose a sample, and the tick does not wait.
    events_.emplace(std::in_place_type<TickedSample>, axis, sample);
  }
  /// Sends the encoder edges of each tick before its samples from now on.
  void send_edges_of(const Bench& bench) noexcept { bench_ = &bench; }

 private:
  Recorder* recorder_;
  SpscQueue<TickEvent>& events_;
  const Bench* bench_ = nullptr;
};

}  // namespace drivebench
