#include "clients/link/tcp/tcp_axis.hpp"

#include <cstddef>
#include <span>
#include <string>

namespace drivebench::link {

std::optional<std::uint32_t> sharer_of_amplifier(const v1::BenchDescription& bench, std::uint32_t axis) {
  const std::string& name = bench.axes(static_cast<int>(axis)).name();
  for (int other = 0; other < bench.axes_size(); ++other) {
    if (bench.axes(other).shares_amplifier_with() == name) return static_cast<std::uint32_t>(other);
  }
  return std::nullopt;
}

TcpAxis::TcpAxis(std::unique_ptr<Link> link, std::uint32_t axis)
    : link_(std::move(link)), axis_(axis), second_axis_(sharer_of_amplifier(bench(), axis)) {}

const Sample& TcpAxis::newest() {
  return keep(link_->exchange({}));
}

const Sample& TcpAxis::exchange(const AxisCommand& command) {
  AxisCommand ours = command;
  ours.axis = axis_;
  return keep(link_->exchange(std::span(&ours, 1)));
}

const Sample& TcpAxis::keep(const v1::ExchangeReply& reply) {
  bool found = false;
  for (const v1::AxisSample& each : reply.samples()) {
    if (each.axis() == axis_) {
      sample_ = plain(each.sample());
      found = true;
    } else if (each.axis() == second_axis_) {
      second_ = plain(each.sample());
    }
  }
  if (found) return sample_;
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
