#include "clients/link/tcp/tcp_axis.hpp"

#include <cstddef>
#include <span>
#include <string>

namespace drivebench::link {

const Sample& TcpAxis::newest() {
  return keep(link_->exchange({}));
}

const Sample& TcpAxis::exchange(const AxisCommand& command) {
  AxisCommand ours = command;
  ours.axis = axis_;
  return keep(link_->exchange(std::span(&ours, 1)));
}

const Sample& TcpAxis::keep(const v1::ExchangeReply& reply) {
  for (const v1::AxisSample& each : reply.samples()) {
    if (each.axis() != axis_) continue;
    sample_ = plain(each.sample());
    return sample_;
  }
  throw LinkError(link_->peer() + " answered without a sample of axis " + std::to_string(axis_));
}

Sample plain(const v1::Sample& message) {
  const google::protobuf::Descriptor& fields = *v1::Sample::descriptor();
  const google::protobuf::Reflection& read = *message.GetReflection();
  Sample sample;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    const Signal& signal = kSignals[i];
    const auto* field = fields.field(static_cast<int>(i));
    switch (signal.type) {
      case SignalType::kUnsigned:
        sample.*signal.as_unsigned = read.GetUInt64(message, field);
        break;
      case SignalType::kSigned:
        sample.*signal.as_signed = read.GetInt64(message, field);
        break;
      case SignalType::kReal:
        sample.*signal.as_real = read.GetDouble(message, field);
        break;
    }
  }
  return sample;
}

}  // namespace drivebench::link
