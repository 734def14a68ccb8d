#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "plant/axis_parameters.hpp"
#include "plant/axis_state.hpp"
#include "plant/faults.hpp"
#include "plant/train/train.hpp"
#include "protocols/signals/sample.hpp"

namespace drivebench {

/// What the sensors of a sample do not tell at an instant within a tick.
struct GateTruth {
  ThreePhase current_a{};
  double torque_nm = 0.0;
  double load_nm = 0.0;
  double magnetic_j = 0.0;  ///< in the field of the machine
  std::uint32_t hall_lines = 0;
};

/// One emulated drive train: drive, machine, shaft, load and sensors.
class Axis {
 public:
  /// The parameters must be free of problems().
  Axis(const AxisParameters& p, AxisTiming timing, std::uint64_t seed, std::uint64_t index);
  Axis(const Axis& other);
  Axis& operator=(const Axis& other);
  Axis(Axis&&) noexcept = default;
  Axis& operator=(Axis&&) noexcept = default;
  ~Axis() = default;

  /// Integrates one tick from `tick` to `tick` + 1 under the command.
  void advance(const PhaseCommand& command, Tick tick) noexcept;

  /// The same for two axes on one shaft: the rotor of `second` turns with the output of `first`, whose
  /// mechanics and load are those of both.
  static void advance_pair(Axis& first, Axis& second, const PhaseCommand& first_command,
                           const PhaseCommand& second_command, Tick tick) noexcept;

  /// The same for two axes whose machines are in parallel on the amplifier of `first`: both have its
  /// voltages, and a latched fault of one is that of both. The drive parameters of both must be equal.
  static void advance_on_one_amplifier(Axis& first, Axis& second, const PhaseCommand& command,
                                       Tick tick) noexcept;

  // A tick in parts, at gate level (GateAxis), where the legs of a switched inverter are at levels and no
  // command is in force: open_tick(), run_part() from its start to its end, close_tick().

  void open_tick(Tick tick) noexcept;
  /// Copies a state of this axis over another one of it, but for what stands still at gate level, four fifths
  /// of it: the commands of a drive and what the sensors of a sample hold.
  static void copy_but_standing(const AxisState& from, AxisState& to) noexcept;
  /// From start_s to end_s within the tick, at most a step. The currents of the terminals at its end; none
  /// if the state is not finite: the axis then stands where it was and has the fault `diverged`.
  std::optional<PhaseValues> run_part(const LegLevels& levels, double start_s, double end_s) noexcept;
  void close_tick() noexcept;
  /// Back to a state that was kept within this tick or one before it, opened and not closed.
  void go_back(const AxisState& state, Tick tick) noexcept;
  /// From now on parts report to this one; null: to none.
  void report_to(GateTap* tap) noexcept { core_.tap = tap; }
  /// Torque, energy and currents at this instant, which is in this tick.
  GateTruth gate_truth(Tick tick) const noexcept;
  /// Parameters or faults have changed within this tick: the drive takes them at once, and a stiff link has
  /// its new voltage.
  void take_changes(Tick tick) noexcept;

  /// Sensors and truth at the start of `tick`, after the advance that led there: a pure function of state and
  /// tick. The bench's state of commands, leases and late ticks is not in it.
  Sample sample(Tick tick) const noexcept;

  /// Changes parameters while running; they hold from the next advance on. The kind of machine stays.
  void set_parameters(const AxisParameters& p) noexcept;
  const AxisParameters& parameters() const noexcept { return core_.p; }

  const AxisState& state() const noexcept { return state_; }
  void restore(const AxisState& state) noexcept;

  void set_load(double target_nm, Tick tick, Tick ramp_ticks) noexcept {
    state_.load.go_to(target_nm, tick, ramp_ticks);
  }
  /// A bump of the rotor: its speed jumps.
  void bump(double impulse_nms) noexcept;
  /// The same on the output of its gear or shaft.
  void bump_output(double impulse_nms) noexcept;
  /// Puts the fault of this row of kInjectableFaults in force; 0 takes it back.
  void inject(std::size_t row, double value) noexcept;
  const InjectedFaults& injected() const noexcept { return state_.injected; }
  void latch(std::uint64_t faults) noexcept { state_.faults |= faults; }
  void clear_faults() noexcept { state_.faults &= ~kLatchedFaults; }

  /// The rotor during the last tick, for Encoder::for_each_edge.
  std::span<const AngleSegment> last_tick() const noexcept { return core_.last_tick(); }
  std::int64_t last_tick_turn() const noexcept { return core_.last_tick_turn; }
  const EncoderState& last_tick_encoder() const noexcept {
    return core_.last_tick_encoder;
  }  ///< at its start
  const Encoder& encoder() const noexcept { return core_.encoder; }
  const AxisTiming& timing() const noexcept { return core_.timing; }
  Connection connection() const noexcept { return core_.connection; }

 private:
  /// To which a tick that diverges goes back.
  struct MotionState {
    MachineWords machine;
    TwoMassState shaft;
  };

  /// Whether one of two axes that run together has diverged: then both have.
  static bool has_diverged(Axis& first, Axis& second) noexcept;
  static void end_both(Axis& first, const MotionState& first_before, Axis& second,
                       const MotionState& second_before, Tick tick) noexcept;
  MotionState motion() const noexcept { return {.machine = state_.machine, .shaft = state_.shaft}; }
  void begin_tick(const PhaseCommand& command, Tick tick) noexcept;
  /// The break input at the start of a tick: the fault line, and what the tick before has left.
  void begin_break() noexcept;
  void begin_bootstrap() noexcept;
  void follow_rotor() noexcept;
  void end_tick(const MotionState& before, Tick tick) noexcept;
  /// The currents that the sensors convert.
  PhaseValues sensed_currents() const noexcept;
  void hold(const MotionState& before) noexcept;
  /// go_back() where the drive does not have this tick, or had it with other faults.
  void reopen(const AxisState& state, Tick tick) noexcept;
  double load_at(Tick tick) const noexcept;
  void adjust() noexcept;
  /// Works out what the machine shows in this state.
  void look_inside() noexcept;
  bool finite() const noexcept;

  AxisCore core_;
  std::unique_ptr<Train> train_;
  AxisState state_;
  MachineTruth truth_;   ///< follows from the state; at gate level it is not kept up to date
  Tick open_tick_ = -1;  ///< the last one of open_tick(), since restore()
};

/// The number of integration steps for a tick of this length, at most kMaxSubsteps. A step is at most a tenth
/// of the fastest time constant of mechanics and of the machine behind its source's impedance, 0.2 rad of the
/// electrical angle at the speed at which the emf of a magnet reaches the voltage limit, 50 us, and under a
/// current loop 20 us and L/(2 (K_P + R)).
int default_substeps(const AxisParameters& p, double period_s) noexcept;

}  // namespace drivebench
