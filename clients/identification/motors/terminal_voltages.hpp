#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// The measured voltages of a record at every instant [V].
///
/// A value that is the mean of a period, Processing::voltage_shift s with |s| >= 1/2, is constant within that
/// period: between the samples k and k + 1 the terminals have u(k + s + 1/2), which needs no interpolation
/// with whole s + 1/2 and else is the mean of the two values that share the period. A value at an instant,
/// |s| < 1/2, runs through the cubic of value_at(), and so does one that comes whole samples late or early.
class TerminalVoltages {
 public:
  TerminalVoltages(const MeasuredData& data, const Settings& settings);
  /// At `part`, 0 to 1, of the period that begins at sample `sample`.
  std::array<double, 3> at(std::size_t sample, double part) const noexcept;
  /// Root of the mean square over samples and phases in the window.
  double rms(const SampleRange& range) const noexcept;
  /// The white part of the noisiest phase in the window, rms, without a model.
  double white_v(const SampleRange& range) const;
  /// Those of every `by`-th sample from `first` on, with periods so many times as long.
  TerminalVoltages thinned(std::size_t first, std::size_t by) const;
  std::size_t phases() const noexcept { return u_.size(); }

 private:
  std::vector<Series> u_;  ///< held: of the period after each sample; else as measured
  double shift_;
  bool held_;
};

/// The number of phases whose currents and voltages a motor of these settings has.
std::size_t phases_of(const Settings& settings) noexcept;

}  // namespace drivebench::identification
