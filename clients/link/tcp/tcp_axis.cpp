#include "clients/link/tcp/tcp_axis.hpp"

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

const Sample& TcpAxis::keep(std::span<const AxisSample> samples) {
  bool found = false;
  for (const AxisSample& each : samples) {
    if (each.axis == axis_) {
      sample_ = each.sample;
      found = true;
    } else if (each.axis == second_axis_) {
      second_ = each.sample;
    }
  }
  if (found) return sample_;
  throw LinkError(link_->peer() + " answered without a sample of axis " + std::to_string(axis_));
}

}  // namespace drivebench::link
