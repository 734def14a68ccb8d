#include "server/endpoints/tcp/session/requests/scope_trigger.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "protocols/text.hpp"

namespace drivebench {

void ScopeTrigger::set(const v1::Trigger& r) {
  if (r.condition() == v1::TRIGGER_CONDITION_UNSPECIFIED) {
    end();
    return dialogue_.done(dialogue_.id(), dialogue_.engine().tick());
  }
  std::optional<CaptureSettings> settings = read_settings(r);
  if (!settings || !fits(*settings)) return;
  end();
  capture_.emplace(*std::move(settings), number_, dialogue_.context().captures);
  dialogue_.context().audience.add_watcher(*this);
  dialogue_.done(dialogue_.id(), dialogue_.engine().tick());
}

void ScopeTrigger::end() {
  if (!capture_) return;
  dialogue_.context().audience.remove_watcher(*this);
  number_ = capture_->number();
  capture_.reset();
}

/// Nothing after it has refused the request.
std::optional<CaptureSettings> ScopeTrigger::read_settings(const v1::Trigger& r) {
  if (!dialogue_.axis_exists(r.axis())) return std::nullopt;
  CaptureSettings settings{.axis = r.axis(),
                           .event = {},
                           .ticks_before = r.ticks_before(),
                           .ticks_after = r.ticks_after(),
                           .hold_off_ticks = r.hold_off_ticks(),
                           .is_single = r.single(),
                           .channels = {}};
  if (!read_event(r, settings.event) || !read_channels(r, settings)) return std::nullopt;
  if (r.ticks_after() == 0) {
    refuse(v1::REFUSAL_OUT_OF_RANGE, "ticks_after is 0 but must be at least 1, the tick of the event",
           "ticks_after");
    return std::nullopt;
  }
  if (settings.most_rows() > CaptureSettings::kMaxTicks) {
    refuse(v1::REFUSAL_OUT_OF_RANGE,
           fmt::format("ticks_before and ticks_after are {} ticks together but may be {}",
                       settings.most_rows(), CaptureSettings::kMaxTicks),
           "ticks_before");
    return std::nullopt;
  }
  if (settings.numbers() > CaptureSettings::kMaxNumbers) {
    refuse(v1::REFUSAL_OUT_OF_RANGE,
           fmt::format("{} ticks of {} numbers each, the tick and the captured signals, are {} but may be {}",
                       settings.most_rows(), settings.row_size(), settings.numbers(),
                       CaptureSettings::kMaxNumbers),
           "captured");
    return std::nullopt;
  }
  return settings;
}

bool ScopeTrigger::read_event(const v1::Trigger& r, TriggerEvent& event) {
  if (r.condition() < v1::TRIGGER_RISING || r.condition() > v1::TRIGGER_EQUALS) {
    return refuse(v1::REFUSAL_OUT_OF_RANGE,
                  fmt::format("condition is {} but must be 0 to {}", static_cast<int>(r.condition()),
                              static_cast<int>(v1::TRIGGER_EQUALS)),
                  "condition");
  }
  event = {.kind = static_cast<TriggerEventKind>(r.condition() - v1::TRIGGER_RISING),
           .signal = find_signal(r.signal()),
           .level = r.level(),
           .upper = r.upper(),
           .bits = r.bits()};
  if (event.signal == nullptr) {
    return refuse(v1::REFUSAL_UNKNOWN_SIGNAL, "there is no signal '" + printable(r.signal()) + "'", "signal");
  }
  if (event.kind == TriggerEventKind::kBitsAppear) {
    if (event.signal->type != SignalType::kUnsigned) {
      return refuse(v1::REFUSAL_OUT_OF_RANGE,
                    fmt::format("'{}' is a number without bits", event.signal->name), "signal");
    }
    return event.bits != 0 || refuse(v1::REFUSAL_OUT_OF_RANGE, "bits is 0, of which none can appear", "bits");
  }
  if (!std::isfinite(event.level)) {
    return refuse(v1::REFUSAL_NOT_FINITE, "level is not a finite number", "level");
  }
  if (event.kind != TriggerEventKind::kLeaves && event.kind != TriggerEventKind::kEnters) return true;
  if (!std::isfinite(event.upper)) {
    return refuse(v1::REFUSAL_NOT_FINITE, "upper is not a finite number", "upper");
  }
  return event.upper >= event.level ||
         refuse(v1::REFUSAL_OUT_OF_RANGE,
                fmt::format("upper is {} but must not be below level, {}", event.upper, event.level),
                "upper");
}

bool ScopeTrigger::read_channels(const v1::Trigger& r, CaptureSettings& settings) {
  for (const v1::CapturedSignals& each : r.captured()) {
    if (!dialogue_.axis_exists(each.axis())) return false;
    for (const std::string& name : each.signals()) {
      const CaptureSettings::Channel channel{.axis = each.axis(), .signal = find_signal(name)};
      if (channel.signal == nullptr) {
        return refuse(v1::REFUSAL_UNKNOWN_SIGNAL, "there is no signal '" + printable(name) + "'",
                      "captured.signals");
      }
      if (std::ranges::find(settings.channels, channel) != settings.channels.end()) {
        return refuse(v1::REFUSAL_OUT_OF_RANGE,
                      fmt::format("'{}' of axis {} is captured twice", name, each.axis()),
                      "captured.signals");
      }
      settings.channels.push_back(channel);
    }
  }
  return !settings.channels.empty() ||
         refuse(v1::REFUSAL_OUT_OF_RANGE, "captured names no signal", "captured");
}

/// Whether the server has room for it in the place of the present one.
bool ScopeTrigger::fits(const CaptureSettings& settings) {
  const CapturePool& pool = dialogue_.context().captures;
  const std::size_t own = capture_ ? capture_->settings().numbers() : 0;
  if (pool.captures - (capture_ ? 1 : 0) >= CapturePool::kMaxCaptures) {
    return refuse(v1::REFUSAL_BUSY,
                  fmt::format("the sessions have {} triggers, the most that the server watches for",
                              CapturePool::kMaxCaptures),
                  "condition");
  }
  if (pool.numbers - own + settings.numbers() > CapturePool::kMaxNumbers) {
    return refuse(v1::REFUSAL_BUSY,
                  fmt::format("the capture takes {} numbers, and of the {} for all sessions {} are free",
                              settings.numbers(), CapturePool::kMaxNumbers,
                              CapturePool::kMaxNumbers - (pool.numbers - own)),
                  "captured");
  }
  return true;
}

/// Always false.
bool ScopeTrigger::refuse(v1::RefusalCode code, const std::string& sentence, const char* field) {
  dialogue_.refuse(dialogue_.id(), code, sentence, field);
  return false;
}

void ScopeTrigger::on_tick() {
  const Capture::Change change = capture_->take(dialogue_.engine().newest());
  if (change == Capture::Change::kNothing) return;
  v1::Triggered& triggered = *dialogue_.begin_reply(0).mutable_triggered();
  triggered.set_capture(capture_->number());
  triggered.set_tick(capture_->event_tick());
  triggered.set_complete(capture_->is_complete());
  if (capture_->is_complete()) triggered.set_rows(static_cast<std::uint32_t>(capture_->rows()));
  triggered.set_missed_events(capture_->missed_events());
  triggered.set_lost_ticks(capture_->lost_ticks());
  dialogue_.send_reply();
}

void ScopeTrigger::read(const v1::ReadCapture& r) {
  if (!capture_ || !capture_->is_complete() || r.capture() != capture_->number()) {
    refuse(v1::REFUSAL_NOT_AVAILABLE, fmt::format("there is no complete capture {}", r.capture()), "capture");
    return;
  }
  if (r.first_row() >= capture_->rows()) {
    refuse(v1::REFUSAL_OUT_OF_RANGE,
           fmt::format("first_row is {} but must be below {}, the rows of the capture", r.first_row(),
                       capture_->rows()),
           "first_row");
    return;
  }
  const std::size_t row_bytes = capture_->settings().row_size() * sizeof(double);
  const std::size_t end = std::min(capture_->rows(), r.first_row() + kBytesPerPiece / row_bytes);
  v1::CaptureRows& rows = *dialogue_.begin_reply(dialogue_.id()).mutable_capture_rows();
  rows.set_capture(r.capture());
  rows.set_first_row(r.first_row());
  std::string& data = *rows.mutable_data();
  data.reserve((end - r.first_row()) * row_bytes);
  for (std::size_t n = r.first_row(); n < end; ++n)
    data.append(reinterpret_cast<const char*>(capture_->row(n).data()), row_bytes);
  rows.set_last(end == capture_->rows());
  if (rows.last() && !capture_->settings().is_single) capture_->arm_again();
  dialogue_.send_reply();
}

}  // namespace drivebench
