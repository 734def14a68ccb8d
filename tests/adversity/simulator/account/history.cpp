#include "tests/adversity/simulator/account/history.hpp"

#include <algorithm>

#include "protocols/signals/catalogue.hpp"

namespace drivebench::simulator {

bool History::agrees(const v1::Sample& told, bool in_status) const {
  const Sample& s = ring_[told.tick() % kSize];
  if (s.tick != told.tick()) return true;
  const google::protobuf::Reflection& fields = *v1::Sample::GetReflection();
  const google::protobuf::Descriptor& message = *v1::Sample::GetDescriptor();
  int number = 0;  // bench.proto lists them in the same order
  return std::ranges::all_of(kSignals, [&](const Signal& signal) {
    const google::protobuf::FieldDescriptor* const field = message.field(number++);
    if (in_status && signal.as_unsigned == &Sample::owner) return true;
    if (signal.type == SignalType::kReal) return fields.GetDouble(told, field) == s.*signal.as_real;
    if (signal.type == SignalType::kSigned) return fields.GetInt64(told, field) == s.*signal.as_signed;
    return fields.GetUInt64(told, field) == s.*signal.as_unsigned;
  });
}

}  // namespace drivebench::simulator
