#include "clients/command/recording/export_can.hpp"

#include <fmt/core.h>

#include <array>

#include "clients/command/common/basics/errors.hpp"
#include "clients/link/common/requests.hpp"
#include "protocols/can/codec.hpp"
#include "protocols/can/command.hpp"
#include "protocols/can/formats/candump.hpp"

namespace drivebench::command {
namespace {

using CanMessage = can::Message;

constexpr std::uint64_t kStateEveryTicks = 80;  // as a bench does by default

}  // namespace

void CandumpText::add(std::uint32_t axis, const Sample& sample, double time_s) {
  if (open_tick_ && *open_tick_ != sample.tick) end_tick();
  open_tick_ = sample.tick;
  open_time_s_ = time_s;
  Before& before = before_[axis];
  if (sample.faults != before.faults) put(CanMessage::kFault, axis, sample, time_s);
  if (sample.index_tick != before.index_tick) put(CanMessage::kIndex, axis, sample, time_s);
  before = {.faults = sample.faults,
            .index_tick = sample.index_tick,
            .wide = before.wide || sample.i_c_a != 0.0 || sample.i_f_a != 0.0 || sample.u_c_v != 0.0 ||
                    sample.u_f_v != 0.0 || sample.hall_lines != 0};
  if (sample.tick % kStateEveryTicks == 0) {
    put(CanMessage::kState, axis, sample, time_s);
    put(CanMessage::kCounters, axis, sample, time_s);
  }
  put(CanMessage::kEncoder, axis, sample, time_s);
  put(CanMessage::kCurrents, axis, sample, time_s);
  put(CanMessage::kSensors, axis, sample, time_s);
  put(CanMessage::kPhases, axis, sample, time_s);
}

void CandumpText::add(const v1::Input& input, double time_s) {
  if (!input.has_command()) return;
  end_tick();
  const v1::Command& command = input.command();
  if (command.gates() == v1::GATES_EDGES) return;  // no frame carries them
  const link::Setpoints x = link::setpoints_of(command);
  const can::CommandFields setpoints{.tick = command.tick(),
                                     .mode = link::can_mode_of(command.gates()),
                                     .lease = static_cast<unsigned>(input.owner() & 0xFF),
                                     .legs_off = command.legs_off(),
                                     .a = x.a,
                                     .b = x.b,
                                     .c = x.c,
                                     .field = x.f};
  bool& wide = before_[input.axis()].wide;
  wide = wide || setpoints.c != 0.0 || setpoints.field != 0.0;
  for (const can::Frame& frame : can::encode_command(address_.profile, node(input.axis()), wide, setpoints)) {
    put(frame, time_s);
  }
}

void CandumpText::finish() {
  end_tick();
}

void CandumpText::end_tick() {
  if (!open_tick_) return;
  const std::array<double, 2> values = {static_cast<double>(*open_tick_), is_lockstep_ ? 1.0 : 0.0};
  put(can::encode(*can::find_message(CanMessage::kSync, address_.profile.fd), address_.profile, 0, values),
      open_time_s_);
  open_tick_.reset();
}

std::uint32_t CandumpText::node(std::uint32_t axis) const {
  const std::uint64_t node = std::uint64_t{address_.node} + axis;
  if (node > address_.profile.max_node())
    throw UsageError(fmt::format("axis {} would have node id {}", axis, node));
  return static_cast<std::uint32_t>(node);
}

/// Nothing if the profile does not have this message.
void CandumpText::put(CanMessage message, std::uint32_t axis, const Sample& sample, double time_s) {
  const can::MessageRow* const row = can::find_message(message, address_.profile.fd, before_[axis].wide);
  if (row != nullptr) put(can::encode_sample(*row, address_.profile, node(axis), sample), time_s);
}

void CandumpText::put(const can::Frame& frame, double time_s) {
  can::append_candump(text_, time_s, address_.channel, frame);
  ++frames_;
}

}  // namespace drivebench::command
