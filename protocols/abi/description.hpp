#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/abi/drivebench.h"
#include "protocols/signals/catalogue.hpp"

namespace drivebench::abi {

/// A drivebench_description with all that it points to. Filled once, row by row; it does not move.
class Description {
 public:
  Description() = default;
  Description(const Description&) = delete;
  Description& operator=(const Description&) = delete;

  drivebench_description bench{};

  /// A copy of the text that lives as long as this description.
  const char* keep(std::string_view text) { return texts_.emplace_back(text).c_str(); }

  /// The parameters of the axis that add_axis() adds next.
  void add_parameter(const drivebench_parameter& parameter) { parameters_.push_back(parameter); }
  void add_axis(drivebench_axis axis) {
    const auto& kept = all_parameters_.emplace_back(std::move(parameters_));
    parameters_.clear();
    axis.parameter_count = kept.size();
    axis.parameters = kept.data();
    axes_.push_back(axis);
  }
  void add_fault(const drivebench_fault& fault) { faults_.push_back(fault); }
  void add_injectable(const drivebench_injectable& fault) { injectables_.push_back(fault); }
  void add_event(const drivebench_event& event) { events_.push_back(event); }

  /// Adds the signals of the catalogue, of which this link knows some, and closes the description.
  void finish(SignalMask known) {
    for (std::size_t row = 0; row < kSignals.size(); ++row) {
      const Signal& signal = kSignals[row];
      signals_.push_back({.name = keep(signal.name),
                          .unit = keep(signal.unit),
                          .meaning = keep(signal.meaning),
                          .kind = static_cast<std::int32_t>(signal.kind) + DRIVEBENCH_KIND_STATUS,
                          .type = static_cast<std::int32_t>(signal.type),
                          .minimum = signal.minimum,
                          .maximum = signal.maximum,
                          .known = static_cast<std::int32_t>(known >> row & 1)});
    }
    const auto show = [](const auto& rows, std::size_t& count, auto& first) {
      count = rows.size();
      first = rows.data();
    };
    show(axes_, bench.axis_count, bench.axes);
    show(signals_, bench.signal_count, bench.signals);
    show(faults_, bench.fault_count, bench.faults);
    show(injectables_, bench.injectable_count, bench.injectables);
    show(events_, bench.event_count, bench.events);
  }

 private:
  std::deque<std::string> texts_;
  std::deque<std::vector<drivebench_parameter>> all_parameters_;
  std::vector<drivebench_parameter> parameters_;
  std::vector<drivebench_axis> axes_;
  std::vector<drivebench_signal> signals_;
  std::vector<drivebench_fault> faults_;
  std::vector<drivebench_injectable> injectables_;
  std::vector<drivebench_event> events_;
};

static_assert(static_cast<int>(SignalKind::kStatus) + DRIVEBENCH_KIND_STATUS == DRIVEBENCH_KIND_STATUS);
static_assert(static_cast<int>(SignalKind::kTruth) + DRIVEBENCH_KIND_STATUS == DRIVEBENCH_KIND_TRUTH);
static_assert(static_cast<int>(SignalType::kUnsigned) == DRIVEBENCH_TYPE_UNSIGNED);
static_assert(static_cast<int>(SignalType::kReal) == DRIVEBENCH_TYPE_REAL);

// drivebench_sample is Sample, member by member.
static_assert(sizeof(drivebench_sample) == sizeof(Sample));
#define DRIVEBENCH_UNSIGNED(kind, name, unit, maximum, meaning) DRIVEBENCH_SAME_PLACE(name)
#define DRIVEBENCH_SIGNED(kind, name, unit, first, minimum, maximum, meaning) DRIVEBENCH_SAME_PLACE(name)
#define DRIVEBENCH_REAL(kind, name, unit, minimum, maximum, meaning) DRIVEBENCH_SAME_PLACE(name)
#define DRIVEBENCH_SAME_PLACE(name)                                            \
  static_assert(offsetof(drivebench_sample, name) == offsetof(Sample, name) && \
                std::is_same_v<decltype(drivebench_sample::name), decltype(Sample::name)>);
#include "protocols/signals/signals.inc"
#undef DRIVEBENCH_SAME_PLACE

}  // namespace drivebench::abi
