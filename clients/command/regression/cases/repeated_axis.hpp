#pragma once

#include "clients/command/recording/recorded_run.hpp"
#include "clients/command/regression/cases/run_case.hpp"
#include "clients/link/common/axis_link.hpp"

namespace drivebench::command {

/// An axis whose controller drives from a tick on: up to there the recorded commands act in the place of its
/// own, so that the bench is where the recorded one was and the controller has seen how it came there.
class RepeatedAxis final : public link::AxisLink {
 public:
  /// Throws UsageError if the recording has no commands for the axis.
  RepeatedAxis(link::AxisLink& axis, const RepeatedPart& part);

  const v1::BenchDescription& bench() const noexcept override { return axis_.bench(); }
  std::uint32_t axis() const noexcept override { return axis_.axis(); }
  SignalMask known() const noexcept override { return axis_.known(); }

  void acquire() override { axis_.acquire(); }
  void release() override { axis_.release(); }
  void clear_faults() override { axis_.clear_faults(); }
  const Sample& newest() override { return axis_.newest(); }
  const Sample* second() const noexcept override { return axis_.second(); }
  const Sample& exchange(const link::AxisCommand& command) override;
  void write_parameter(std::string_view name, double value) override { axis_.write_parameter(name, value); }
  bool can_set_load() const noexcept override { return axis_.can_set_load(); }
  void set_load(const link::LoadChange& change) override { axis_.set_load(change); }

 private:
  link::AxisLink& axis_;
  std::uint64_t until_;
  std::vector<Answered> recorded_{};  ///< in the order of their ticks
};

}  // namespace drivebench::command
