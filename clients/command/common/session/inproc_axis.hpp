#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/link/common/axis_link.hpp"
#include "clients/sdk/drivebench.hpp"

namespace drivebench::command {

/// The link of a controller to an axis of a bench in this process, over the C ABI. It carries all signals,
/// and the samples of all axes.
class InprocAxis final : public link::AxisLink {
 public:
  /// `bench` is a bench file, or the name of one that came with drivebench; `axis` a number or name. Throws
  /// UsageError.
  InprocAxis(const std::string& bench, std::string_view axis);

  const v1::BenchDescription& bench() const noexcept override { return description_; }
  std::uint32_t axis() const noexcept override { return axis_; }
  SignalMask known() const noexcept override { return kAllSignals; }

  void acquire() override;
  void release() override;
  void clear_faults() override;
  const Sample& newest() override;
  const Sample* second() const noexcept override { return second_axis_ ? &samples_[*second_axis_] : nullptr; }
  const Sample& exchange(const link::AxisCommand& command) override;
  void write_parameter(std::string_view name, double value) override;
  bool can_set_load() const noexcept override { return true; }
  void set_load(const link::LoadChange& change) override;

  /// The samples of all axes, of the tick of the last one.
  const std::vector<Sample>& all();

 private:
  template <class Request>
  void request(Request what);
  void read_second();

  client::Bench bench_;
  v1::BenchDescription description_;
  std::uint32_t axis_ = 0;
  std::optional<std::uint32_t> second_axis_;  ///< on the same amplifier
  client::Sample answer_;                     ///< to the last command
  std::vector<Sample> samples_;
};

}  // namespace drivebench::command
