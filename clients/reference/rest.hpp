#pragma once

#include <bench.pb.h>

#include <cstdint>

#include "protocols/signals/catalogue.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench::reference {

/// Brings an axis to rest before a run, sample by sample and with its gates off: 50 ms of the bench's time,
/// in which the rotor flux of a servo motor decays, and longer until the axis is armed and the shaft has run
/// out.
class Rest {
 public:
  enum class State {
    kGoesOn,  ///< this sample wants gates off, and another sample
    kStill,   ///< a run may start with this sample
    kTurns    ///< the shaft still turns after 5 s
  };

  /// `known` are the signals of the link; `counts_per_revolution` gives the speed where `speed_rad_s` is none
  /// of them, 0: no encoder.
  Rest(double period_s, double counts_per_revolution, SignalMask known) noexcept;

  /// `second`: the sample of the second motor of the run, if there is one.
  State see(const Sample& sample, const Sample* second = nullptr) noexcept;
  /// The speed at the end of the last 50 ms, of the faster motor; without `speed_rad_s` the mean of the
  /// second half.
  double speed_rad_s() const noexcept { return speed_rad_s_; }

  /// A bench that has not run yet is at rest, if its first command arms it.
  static bool is_needless(const v1::BenchDescription& bench, const Sample& first) {
    return first.tick == 0 && bench.arming_commands() <= 1;
  }

 private:
  bool is_armed(const Sample& sample) const noexcept;
  double speed_at(const Sample& sample) const noexcept;
  bool knows(SignalMask signal) const noexcept { return (known_ & signal) != 0; }

  double period_s_;
  double rad_per_count_;
  SignalMask known_;
  bool has_start_ = false;
  Sample start_{};
  Sample half_way_{};
  int rests_ = 0;
  double speed_rad_s_ = 0.0;
};

}  // namespace drivebench::reference
