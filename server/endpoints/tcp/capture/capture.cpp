#include "server/endpoints/tcp/capture/capture.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace drivebench {

Capture::Capture(CaptureSettings settings, std::uint64_t number, CapturePool& pool)
    : settings_(std::move(settings)),
      number_(number),
      pool_(pool),
      detector_(settings_.event),
      blocks_((settings_.most_rows() + kRowsPerBlock - 1) / kRowsPerBlock) {
  ++pool_.captures;
  pool_.numbers += settings_.numbers();
}

Capture::~Capture() {
  --pool_.captures;
  pool_.numbers -= settings_.numbers();
}

Capture::Change Capture::take(std::span<const Sample> newest) {
  const Sample& sample = newest[settings_.axis];
  if (has_tick_ && sample.tick == tick_) return Change::kNothing;
  if (has_tick_ && !is_complete()) lost_ticks_ += sample.tick - tick_ - 1;
  has_tick_ = true;
  tick_ = sample.tick;
  const bool is_event = detector_.see(sample) && sample.tick >= quiet_until_;
  return go_on(sample.tick, is_event, newest);
}

Capture::Change Capture::go_on(std::uint64_t tick, bool is_event, std::span<const Sample> newest) {
  if (is_complete() && is_event) {
    ++unkept_events_;
    hold_off(tick);
  }
  if (is_complete()) return Change::kNothing;
  const bool begins = state_ == State::kArmed && is_event;
  if (begins) {
    state_ = State::kCollecting;
    ++number_;
    event_tick_ = tick;
    hold_off(tick);
  }
  const std::uint64_t last = event_tick_ + settings_.ticks_after - 1;
  if (state_ == State::kArmed || tick <= last) keep(tick, newest);
  if (state_ == State::kArmed) return Change::kNothing;
  // Rows are fewer than ticks where samples were lost.
  while (at(begin_)[0] + settings_.ticks_before < static_cast<double>(event_tick_))
    ++begin_;
  if (tick >= last) state_ = State::kComplete;
  return is_complete() ? Change::kComplete : begins ? Change::kEvent : Change::kNothing;
}

void Capture::hold_off(std::uint64_t tick) noexcept {
  quiet_until_ = tick + std::min(settings_.hold_off_ticks, std::numeric_limits<std::uint64_t>::max() - tick);
}

void Capture::keep(std::uint64_t tick, std::span<const Sample> newest) {
  std::unique_ptr<double[]>& block = blocks_[end_ % settings_.most_rows() / kRowsPerBlock];
  if (!block) block = std::make_unique_for_overwrite<double[]>(kRowsPerBlock * settings_.row_size());
  std::span<double> row = at(end_++);
  if (end_ - begin_ > settings_.most_rows()) ++begin_;
  row[0] = static_cast<double>(tick);
  row = row.subspan(1);
  for (std::size_t n = 0; n < row.size(); ++n) {
    const Sample& sample = newest[settings_.channels[n].axis];
    row[n] = sample.tick == tick ? value_of(*settings_.channels[n].signal, sample)
                                 : std::numeric_limits<double>::quiet_NaN();
  }
}

std::span<double> Capture::at(std::size_t row) const noexcept {
  const std::size_t place = row % settings_.most_rows();
  return {blocks_[place / kRowsPerBlock].get() + place % kRowsPerBlock * settings_.row_size(),
          settings_.row_size()};
}

void Capture::begin_anew() noexcept {
  has_tick_ = false;
  quiet_until_ = 0;
  detector_.forget();
  if (is_complete()) return;
  unkept_events_ = missed_events_;  // not told yet
  arm_again();
}

void Capture::arm_again() noexcept {
  state_ = State::kArmed;
  begin_ = end_ = 0;
  lost_ticks_ = 0;
  missed_events_ = std::exchange(unkept_events_, 0);
}

}  // namespace drivebench
