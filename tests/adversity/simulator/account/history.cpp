#include "tests/adversity/simulator/account/history.hpp"

#include <algorithm>

#include "plant/faults.hpp"
#include "protocols/signals/catalogue.hpp"
#include "server/bench/control.hpp"

namespace drivebench::simulator {

namespace {

/// Whether the state is that of the latched faults.
bool shows_latch(const v1::Sample& told) {
  const std::uint64_t latched = told.faults() & kLatchedFaults;
  const auto state = static_cast<ControlState>(told.state());
  if (latched != 0) return state == state_with(latched);
  return state != ControlState::kTimeout && state != ControlState::kFault;
}

}  // namespace

bool History::agrees(const v1::Sample& told, bool in_status) const {
  const Sample& s = ring_[told.tick() % kSize];
  if (s.tick != told.tick()) return true;
  const google::protobuf::Reflection& fields = *v1::Sample::GetReflection();
  const google::protobuf::Descriptor& message = *v1::Sample::GetDescriptor();
  int number = 0;  // bench.proto lists them in the same order
  return std::ranges::all_of(kSignals, [&](const Signal& signal) {
    const google::protobuf::FieldDescriptor* const field = message.field(number++);
    if (in_status && signal.as_unsigned == &Sample::owner) return true;
    if (in_status && signal.as_unsigned == &Sample::state)
      return told.state() == s.state || shows_latch(told);
    if (in_status && signal.as_unsigned == &Sample::faults)
      return ((told.faults() ^ s.faults) & ~kLatchedFaults) == 0;
    if (signal.type == SignalType::kReal) return fields.GetDouble(told, field) == s.*signal.as_real;
    if (signal.type == SignalType::kSigned) return fields.GetInt64(told, field) == s.*signal.as_signed;
    return fields.GetUInt64(told, field) == s.*signal.as_unsigned;
  });
}

}  // namespace drivebench::simulator
