#pragma once

#include "plant/train.hpp"

namespace drivebench {

/// Two machines on one shaft: the rotor of the second is coupled to the output of the first. The mechanics,
/// the load and the shaft's faults are those of the first; the shaft of the second's state follows.
class SharedShaft {
 public:
  SharedShaft(AxisCore& first_core, AxisState& first, Train& first_train, AxisCore& second_core,
              AxisState& second, Train& second_train) noexcept;

  /// All substeps of a tick.
  void run(double load_nm) noexcept;

 private:
  struct Side {
    AxisCore& core;
    AxisState& state;
    Train& train;
  };
  template <class Shaft>
  void run_substeps(double load_nm) noexcept;
  template <class Shaft>
  void run_piece(Shaft& x, double start_s, double end_s, double load_nm) noexcept;
  template <class Shaft>
  Shaft stepped(const Shaft& from, double duration_s, const ShaftBranch& branch, double load_nm) noexcept;
  template <class Shaft>
  RotorMotion second_motion(const Shaft& x) const noexcept;
  static void check_currents(Side& side, const RotorMotion& motion) noexcept;

  Side first_;
  Side second_;
  double output_start_rad_ = 0.0;  ///< angle of the output less that of the second rotor, whole turns of it
};

}  // namespace drivebench
