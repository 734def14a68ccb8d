#include "server/messages/device_messages.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "server/host/logging/log.hpp"

namespace drivebench {
namespace {

template <class Content>
bool has(const DeviceMessage& message) noexcept {
  return std::holds_alternative<Content>(message.content);
}

}  // namespace

DeviceMessages::DeviceMessages(std::vector<DeviceMessage> messages, const std::string& lines,
                               SendFrame send_frame)
    : send_frame_(std::move(send_frame)) {
  if (lines.empty() && std::ranges::any_of(messages, has<LineMessage>))
    throw std::runtime_error("--messages: a message has a line, for which --lines must name a file");
  // For reading, too: a FIFO then needs no reader yet.
  if (!lines.empty()) lines_ = ::open(lines.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC | O_APPEND);
  if (!lines.empty() && lines_ < 0)
    throw std::runtime_error(fmt::format("--lines: {}: {}", lines, std::generic_category().message(errno)));
  if (std::ranges::any_of(messages, has<RegisterMessage>)) writer_.emplace();
  for (DeviceMessage& message : messages)
    pending_.push_back({.message = std::move(message)});
}

DeviceMessages::~DeviceMessages() {
  if (lines_ >= 0) ::close(lines_);
}

void DeviceMessages::serve(Engine& engine) {
  engine_ = &engine;
  engine.on_set_back.add([this] { begin(); });
  engine.on_tick.add([this] { look(); });
  begin();
  look();
}

/// Messages of ticks before this one are from before; conditions are new.
void DeviceMessages::begin() {
  const Tick now = engine_->tick();
  for (Pending& each : pending_) {
    const bool is_past = !each.message.trigger && now > 0 && each.message.tick <= now;
    each = {.message = std::move(each.message), .is_sent = is_past};
  }
}

void DeviceMessages::look() {
  const Tick tick = engine_->tick();
  for (Pending& each : pending_) {
    if (each.is_sent) continue;
    if (!each.message.trigger) {
      each.due = each.message.tick;
    } else if (!each.due) {
      const Trigger& trigger = *each.message.trigger;
      each.held = trigger.condition.holds(engine_->newest(trigger.axis)) ? each.held + 1 : 0;
      if (each.held > trigger.for_ticks) each.due = tick + each.message.tick;
    }
    if (!each.due || tick < *each.due) continue;
    each.is_sent = true;
    send(each.message, tick);
  }
  // Time waits for the controllers in lockstep, and for what they are told.
  if (writer_ && engine_->config().mode == RunMode::kLockstep) writer_->wait();
}

void DeviceMessages::send(const DeviceMessage& message, Tick tick) {
  std::size_t place = 0;
  {
    const std::lock_guard lock(mutex_);
    place = outcomes_.size();
    outcomes_.push_back({.tick = tick, .text = text_of(message)});
  }
  const auto note = [this, place](const std::string& problem) {
    if (problem.empty()) return;
    const std::lock_guard lock(mutex_);
    outcomes_[place].problem = problem;
    log::warn("tick {}: {} did not arrive: {}", outcomes_[place].tick, outcomes_[place].text, problem);
  };
  if (const auto* line = std::get_if<LineMessage>(&message.content)) {
    note(write_line(line->text));
  } else if (const auto* frame = std::get_if<FrameMessage>(&message.content)) {
    note(send_frame_(frame->bus, frame->frame));
  } else {
    writer_->write(std::get<RegisterMessage>(message.content), note);
  }
}

std::string DeviceMessages::write_line(const std::string& text) const {
  const std::string line = text + "\n";
  const ssize_t written = ::write(lines_, line.data(), line.size());
  if (written == static_cast<ssize_t>(line.size())) return {};
  if (written < 0 && errno == EAGAIN) return "the device does not read its standard input, which is full";
  return written < 0 ? std::generic_category().message(errno) : "it was cut off";
}

std::vector<DeviceMessages::Outcome> DeviceMessages::outcomes() {
  if (writer_) writer_->wait();
  const std::lock_guard lock(mutex_);
  return outcomes_;
}

}  // namespace drivebench
