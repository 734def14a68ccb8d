#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "clients/link/common/axis_link.hpp"
#include "clients/link/tcp/tcp_link.hpp"

namespace drivebench::link {

/// The link of a controller over bench.proto, which carries all signals.
class TcpAxis final : public AxisLink {
 public:
  TcpAxis(std::unique_ptr<Link> link, std::uint32_t axis);

  const v1::BenchDescription& bench() const noexcept override { return link_->welcome().bench(); }
  std::uint32_t axis() const noexcept override { return axis_; }
  SignalMask known() const noexcept override { return kAllSignals; }

  void acquire() override { link_->acquire(axis_); }
  void release() override { link_->release(axis_); }
  void clear_faults() override { link_->clear_faults(axis_); }
  const Sample& newest() override;
  const Sample* second() const noexcept override { return second_axis_ ? &second_ : nullptr; }
  const Sample& exchange(const AxisCommand& command) override;
  void write_parameter(std::string_view name, double value) override {
    link_->write_parameter(axis_, {.name = std::string(name), .value = value});
  }
  bool can_set_load() const noexcept override { return true; }
  void set_load(const LoadChange& change) override { link_->set_load(axis_, change); }

 private:
  const Sample& keep(std::span<const AxisSample> samples);

  std::unique_ptr<Link> link_;
  std::uint32_t axis_;
  std::optional<std::uint32_t> second_axis_;  ///< the one that shares its amplifier
  Sample sample_;
  Sample second_;
};

/// The axis that shares the amplifier of this one.
std::optional<std::uint32_t> sharer_of_amplifier(const v1::BenchDescription& bench, std::uint32_t axis);

}  // namespace drivebench::link
