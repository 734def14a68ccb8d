#pragma once

#include "plant/train/train.hpp"

namespace drivebench {

/// Two machines in parallel on the amplifier of the first, each with a shaft of its own: both have its
/// voltages, and it carries the sum of their currents, which counts for its link, its dead time and the
/// over-current. Its output must be constant between its edges: no output filter, no current loop, no source.
///
/// A terminal that no switch drives goes to the rail that the sum of its currents flows into. At a sum of
/// zero it floats where the sum stays zero, until that is beyond a rail; the windings go on with a current of
/// their own around the two machines. This voltage is a mean over each piece of the tick.
class SharedAmplifier {
 public:
  struct Side {
    AxisCore& core;
    AxisState& state;
    Train& train;
    double load_nm;
  };
  /// Both axes have begun the tick.
  SharedAmplifier(const Side& first, const Side& second, const PhaseCommand& command, Tick tick) noexcept;

  /// All substeps of the tick.
  void run() noexcept;

 private:
  /// To which a piece goes back that is tried again.
  struct Start {
    AxisState first;
    AxisState second;
    std::size_t first_segments;
    std::size_t second_segments;
  };
  /// A piece whose terminals are not all driven.
  struct Undriven {
    Start start;
    double start_s;
    TerminalSet dying = 0;     ///< a current flows on into a rail: its zero is an event
    TerminalSet floating = 0;  ///< no sum of currents
  };

  void run_piece(double start_s, double end_s) noexcept;
  void run_both(const TerminalDrive& out, double start_s, double end_s) noexcept;
  /// Runs the piece up to its first event, if it may be cut there; the time of that, and the voltages in
  /// `out`.
  double run_undriven(TerminalDrive& out, double start_s, double end_s, bool may_cut) noexcept;
  Undriven sorted(TerminalDrive& out, double start_s) const noexcept;
  /// Runs the piece anew; the floating terminals get their voltages, or a diode begins to conduct.
  PhaseValues settle(TerminalDrive& out, const Undriven& piece, double end_s) noexcept;
  PhaseValues float_terminals(TerminalDrive& out, const Undriven& piece, TerminalSet floating,
                              double end_s) noexcept;
  PhaseValues try_piece(const TerminalDrive& out, const Undriven& piece, double end_s) noexcept;
  bool clamp_one(TerminalDrive& out, TerminalSet& floating) const noexcept;
  void share_trip() noexcept;
  /// Lets legs open that are to open now. Where they open next, if that is before end_s.
  double break_stop_s(double start_s, double end_s) noexcept;
  PhaseValues total_a() const noexcept;
  TerminalSet terminals() const noexcept { return all_terminals(first_.core.connection); }

  Side first_;
  Side second_;
  Drive drive_;
  DriveMemory memory_;
};

}  // namespace drivebench
