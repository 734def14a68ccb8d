#pragma once

#include "plant/train/train.hpp"

namespace drivebench {

/// Two machines on one shaft: the rotor of the second is coupled to the output of the first. The mechanics,
/// the load are those of the first; the shaft of the second's state follows. A rotor that is blocked by a
/// fault of its axis stands: the second one holds the output.
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
  struct Events {
    EventValues values{};
    int second = 0;  ///< index of the first one of the second machine
  };
  /// The part of a piece up to its first event, and which one of a machine's it is; negative: none.
  struct Cut {
    double fraction = 1.0;
    int first_event = -1;
    int second_event = -1;
    Freed freed{};
  };
  struct Torques {
    double driving_nm = 0.0;  ///< on the rotor of the first machine
    double output_nm = 0.0;   ///< against the output
  };
  template <class Shaft>
  void run_substeps(double load_nm) noexcept;
  template <class Shaft>
  void run_piece(Shaft& x, double start_s, double end_s, double load_nm) noexcept;
  template <class Shaft>
  Shaft stepped(const Shaft& from, double duration_s, const ShaftBranch& branch, double load_nm) noexcept;
  template <class Shaft>
  Torques torques_at(PieceEnd end, const Shaft& x, double load_nm) const noexcept;
  template <class Shaft>
  Events events_at(PieceEnd end, const Shaft& x, const ShaftBranch& branch, double load_nm) const noexcept;
  template <class Shaft>
  Cut cut_at_event(const Shaft& from, Shaft& x, double start_s, double duration_s, const ShaftBranch& branch,
                   double load_nm) noexcept;
  template <class Shaft>
  ShaftBranch branch_at(const Shaft& x, double load_nm, Freed freed) const noexcept;
  template <class Shaft>
  RotorMotion second_motion(const Shaft& x) const noexcept;
  static bool is_blocked(const Side& side) noexcept { return side.state.injected.blocked_rotor != 0.0; }
  static void meet_break_of(Side& side, double now_s, const RotorMotion& motion) noexcept;
  static void check_currents(Side& side, const RotorMotion& motion) noexcept;

  Side first_;
  Side second_;
  double output_start_rad_ = 0.0;  ///< angle of the output less that of the second rotor, whole turns of it
};

}  // namespace drivebench
