#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "plant/axis_parameters.hpp"
#include "plant/axis_state.hpp"
#include "plant/faults.hpp"
#include "plant/train/events.hpp"
#include "plant/train/gate_tap.hpp"

namespace drivebench {

// A piece of a tick is cut at each event (a current or a speed reaches zero, a diode begins to conduct, the
// emf has a corner), at most this often.
inline constexpr std::size_t kMaxEvents = 10;
// Edges of the drive in a tick, and the events on the way.
inline constexpr std::size_t kMaxSegments = kMaxSubsteps * (kMaxEvents + 1) + 256;

/// All of an axis but its machine and its state.
struct AxisCore {
  AxisParameters p;
  AxisTiming timing;
  double step_s;
  Connection connection;
  double pole_pairs;  ///< electrical over mechanical angle, for the Hall sensors
  Drive drive;
  SensorBank sensors;
  Comparators comparators;
  Shunts shunts;
  Encoder encoder;
  AbsoluteEncoder absolute;
  HallCapture hall;
  Bootstrap bootstrap;
  ShaftConstants shaft;
  bool shaft_has_events;
  Tick tick = 0;        ///< that is running
  bool follows = true;  ///< in this tick drive, sensors or thermal model need every piece
  bool breaks = false;  ///< in this tick the break input may open the legs
  std::array<AngleSegment, kMaxSegments> segments{};
  std::size_t segment_count = 0;
  std::uint64_t injected_bits = 0;  ///< of the injected faults, as a sample shows them
  std::int64_t last_tick_turn = 0;
  EncoderState last_tick_encoder{};  ///< at its start
  GateTap* tap = nullptr;            ///< to which pieces report at gate level

  std::span<const AngleSegment> last_tick() const noexcept { return {segments.data(), segment_count}; }
  void record(const AngleSegment& segment) noexcept {
    if (segment_count < kMaxSegments) segments[segment_count++] = segment;
  }
};

/// The true values of a machine at one instant.
struct MachineTruth {
  WindingValues current_a{};
  double torque_nm = 0.0;
  TwoPhase rotor_flux_wb{};
};

enum class PieceEnd { kStart, kNow };  ///< of a piece of a tick: where it began, where its stages have led

/// The integration of a drive train with one kind of machine. Stateless between ticks.
class Train {
 public:
  Train() = default;
  Train(const Train&) = default;
  Train& operator=(const Train&) = default;
  virtual ~Train() = default;
  virtual std::unique_ptr<Train> clone() const = 0;

  /// Takes the constants of a machine of the same kind, with heat, faults and series impedance.
  virtual void set_machine(const MachineParameters& machine, const Adjustment& adjustment) noexcept = 0;

  /// All substeps of a tick. `load_nm` is the active load at the output.
  virtual void run(AxisCore& core, AxisState& state, double load_nm) noexcept = 0;

  /// A part of a tick in which the drive has one constant output, without the check of the currents: those of
  /// the terminals at its end. With AxisCore::tap the voltages of a sample are not worked out.
  virtual PhaseValues run_part(AxisCore& core, AxisState& state, double start_s, double end_s,
                               double load_nm) noexcept = 0;

  virtual MachineTruth truth(const AxisState& state, const RotorMotion& motion) const noexcept = 0;
  /// In the magnetic field.
  virtual double stored_energy_j(const AxisState& state, const RotorMotion& motion) const noexcept = 0;

  // Stage by stage, for two machines on one shaft. Order: open(), then for each stage torque_nm_at() of
  // both and stage() of both, then find_corner() and add_events(); shorten() and the stages again until an
  // event is found; then close().

  /// Connects drive and windings for a piece of the tick, the first from a substep or edge on or a later one.
  virtual void open(AxisCore& core, AxisState& state, double start_s, double duration_s,
                    const RotorMotion& motion, bool is_first) noexcept = 0;
  virtual double torque_nm_at(PieceEnd end, const RotorMotion& motion) const noexcept = 0;
  /// Stage 0 to 3 of a Runge-Kutta step.
  virtual void stage(int number, double duration_s, const RotorMotion& motion) noexcept = 0;
  /// Goes back to the start of the piece, of which only so much will be run.
  virtual void shorten(AxisCore& core, AxisState& state, double start_s, double duration_s,
                       const RotorMotion& motion) noexcept = 0;
  /// Looks for a corner of the emf on the way through the whole piece.
  virtual void find_corner(const RotorMotion& from, const RotorMotion& to) noexcept = 0;
  /// Appends the values whose passing through zero ends the piece.
  virtual void add_events(const AxisCore& core, const AxisState& state, PieceEnd end,
                          const RotorMotion& motion, EventValues& values) const noexcept = 0;
  /// Takes the end of the piece into the state; `event` is the one of add_events() that ends it, negative if
  /// none of this train does.
  virtual void close(AxisCore& core, AxisState& state, double start_s, double duration_s,
                     const RotorMotion& from, const RotorMotion& to, int event) noexcept = 0;
};

/// Whether the source has an impedance of its own.
bool has_impedance(const DriveParameters& p) noexcept;

/// Over-current: the fault bits, and with amplifier.over_current_trip the gates off.
void trip(AxisCore& core, AxisState& state) noexcept;

/// Whether a current may pull the break input now.
inline bool watches_break(const AxisCore& core, const AxisState& state) noexcept {
  return core.p.drive.inverter.break_current_a > 0.0 && state.break_input.pending == 0 &&
         (state.faults & kBreakInput) == 0;
}

/// The break input is pulled at this instant of the tick.
void pull_break(const AxisCore& core, AxisState& state, double now_s) noexcept;

/// At the start of each piece where AxisCore::breaks: a current beyond the limit pulls the break input, and
/// the legs open if their time has come. Whether they have opened.
bool meet_break(AxisCore& core, AxisState& state, double now_s, const PhaseValues& current_a) noexcept;

/// At the start of each piece where Bootstrap::used(): the supplies of the upper switches follow their legs.
void meet_bootstrap(AxisCore& core, AxisState& state, double now_s) noexcept;

/// The end of a piece that is to go from start_s to end_s: where legs open or currents are converted, if
/// that is before.
inline double piece_stop_s(const AxisCore& core, const AxisState& state, double start_s,
                           double end_s) noexcept {
  double stop_s = core.shunts.used() ? core.shunts.stop_s(start_s, end_s) : end_s;
  if (core.bootstrap.used()) stop_s = core.bootstrap.stop_s(state.bootstrap, stop_s);
  return core.breaks && state.break_input.opens_s() < stop_s ? state.break_input.due_s : stop_s;
}

/// After each substep: over-current faults and the trip. Whether there was one.
inline bool check_over_current(AxisCore& core, AxisState& state, const PhaseValues& current_a) noexcept {
  const double limit_a = core.p.drive.amplifier.over_current_a;
  if (std::abs(current_a.a) <= limit_a && std::abs(current_a.b) <= limit_a &&
      std::abs(current_a.c) <= limit_a)
    return false;
  trip(core, state);
  return true;
}

}  // namespace drivebench
