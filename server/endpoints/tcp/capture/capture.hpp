#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "server/endpoints/tcp/capture/trigger_event.hpp"

namespace drivebench {

/// What all captures of a server have together.
struct CapturePool {
  static constexpr std::size_t kMaxCaptures = 32;
  static constexpr std::size_t kMaxNumbers = std::size_t{8} * 1024 * 1024;  ///< of 8 bytes
  std::size_t captures = 0;
  std::size_t numbers = 0;
};

/// What a capture keeps, and around which event.
struct CaptureSettings {
  struct Channel {
    std::uint32_t axis;
    const Signal* signal;
    friend bool operator==(const Channel&, const Channel&) = default;
  };

  static constexpr std::uint64_t kMaxTicks = 65'536;
  static constexpr std::size_t kMaxNumbers = std::size_t{1} << 20;
  static constexpr std::size_t kMaxChannels = 64;

  std::uint32_t axis;  ///< of the event
  TriggerEvent event;
  std::uint32_t ticks_before;
  std::uint32_t ticks_after;  ///< from the event on, at least 1
  std::uint64_t hold_off_ticks;
  bool is_single;
  std::vector<Channel> channels;

  std::size_t row_size() const noexcept { return 1 + channels.size(); }
  std::size_t most_rows() const noexcept { return std::size_t{ticks_before} + ticks_after; }
  std::size_t numbers() const noexcept { return row_size() * most_rows(); }
};

/// Keeps the newest samples until an event comes, then those around it until they have been read. It takes a
/// sample after each tick that reaches the I/O thread, and memory as its rows come, never above
/// CaptureSettings::numbers(). The pool has room for it and outlives it.
class Capture {
 public:
  /// What has changed with a sample.
  enum class Change { kNothing, kEvent, kComplete };

  /// Its captures have the numbers after `number`.
  Capture(CaptureSettings settings, std::uint64_t number, CapturePool& pool);
  ~Capture();
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

  /// The newest sample of each axis.
  Change take(std::span<const Sample> newest);
  /// The bench has gone to another state. A complete capture stays, another one begins again.
  void begin_anew() noexcept;
  /// Looks for the next event. After it was complete.
  void arm_again() noexcept;

  bool is_complete() const noexcept { return state_ == State::kComplete; }
  /// Of the newest capture.
  std::uint64_t number() const noexcept { return number_; }
  std::uint64_t event_tick() const noexcept { return event_tick_; }
  /// Of a complete capture.
  std::size_t rows() const noexcept { return end_ - begin_; }
  /// Row n of a complete capture: its tick, then a value for each channel; NaN: the sample of that axis was
  /// lost.
  std::span<const double> row(std::size_t n) const noexcept { return at(begin_ + n); }
  /// Events between the capture before and this one, of which nothing was kept.
  std::uint64_t missed_events() const noexcept { return missed_events_; }
  /// Ticks since it was armed whose samples did not come.
  std::uint64_t lost_ticks() const noexcept { return lost_ticks_; }
  const CaptureSettings& settings() const noexcept { return settings_; }

 private:
  enum class State { kArmed, kCollecting, kComplete };
  static constexpr std::size_t kRowsPerBlock = 256;

  Change go_on(std::uint64_t tick, bool is_event, std::span<const Sample> newest);
  void hold_off(std::uint64_t tick) noexcept;
  void keep(std::uint64_t tick, std::span<const Sample> newest);
  std::span<double> at(std::size_t row) const noexcept;

  CaptureSettings settings_;
  std::uint64_t number_;
  CapturePool& pool_;
  EventDetector detector_;
  std::vector<std::unique_ptr<double[]>> blocks_;  // row n at n modulo most_rows()
  State state_ = State::kArmed;
  bool has_tick_ = false;
  std::uint64_t tick_ = 0;         // of the sample before
  std::uint64_t quiet_until_ = 0;  // the hold-off
  std::uint64_t event_tick_ = 0;
  std::size_t begin_ = 0;  // of the rows that are kept
  std::size_t end_ = 0;
  std::uint64_t unkept_events_ = 0;  // since the capture was complete
  std::uint64_t missed_events_ = 0;
  std::uint64_t lost_ticks_ = 0;
};

}  // namespace drivebench
