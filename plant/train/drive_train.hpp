#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

#include "plant/math/rk4.hpp"
#include "plant/math/rotated.hpp"
#include "plant/math/trig.hpp"
#include "plant/train/events.hpp"
#include "plant/train/train.hpp"

namespace drivebench {

/// A train with a machine of this kind, whose rotor turns a rigid shaft (ShaftState) or one of two masses
/// (TwoMassState).
template <class Machine, class Shaft>
class DriveTrain final : public Train {
 public:
  using State = typename Machine::State;

  explicit DriveTrain(const MachineParameters& machine) noexcept { set_machine(machine, {}); }

  std::unique_ptr<Train> clone() const override { return std::make_unique<DriveTrain>(*this); }

  void set_machine(const MachineParameters& machine, const Adjustment& adjustment) noexcept override {
    const auto p = adjusted(*std::get_if<typename Machine::Parameters>(&machine), adjustment);
    c_ = constants_of(p);
    pole_pairs_ = pole_pairs_of(p);
  }

  void run(AxisCore& core, AxisState& state, double load_nm) noexcept override;
  PhaseValues run_part(AxisCore& core, AxisState& state, double start_s, double end_s,
                       double load_nm) noexcept override;
  MachineTruth truth(const AxisState& state, const RotorMotion& motion) const noexcept override;
  double stored_energy_j(const AxisState& state, const RotorMotion& motion) const noexcept override {
    return drivebench::stored_energy_j(c_, machine_of(state), turned(motion));
  }

  void open(AxisCore& core, AxisState& state, double start_s, double duration_s, const RotorMotion& motion,
            bool is_first) noexcept override;
  double torque_nm_at(PieceEnd end, const RotorMotion& motion) const noexcept override {
    return torque_nm(c_, end == PieceEnd::kStart ? piece_.from : piece_.stage, turned(motion));
  }
  void stage(int number, double duration_s, const RotorMotion& motion) noexcept override;
  void shorten(AxisCore& core, AxisState& state, double start_s, double duration_s,
               const RotorMotion& motion) noexcept override;
  void find_corner(const RotorMotion& from, const RotorMotion& to) noexcept override {
    piece_.corner = corner_between(from, to);
  }
  void add_events(const AxisCore& core, const AxisState& state, PieceEnd end, const RotorMotion& motion,
                  EventValues& values) const noexcept override;
  void close(AxisCore& core, AxisState& state, double start_s, double duration_s, const RotorMotion& from,
             const RotorMotion& to, int event) noexcept override;

 private:
  /// The continuous state, integrated as one vector.
  struct Whole {
    State machine;
    Shaft shaft;
  };

  /// The values that are computed at the start of a piece.
  struct Piece {
    State from{};
    State stage{};
    State sum{};
    TerminalDrive drive{};
    TerminalCircuit circuit{};
    double corner = 0.0;      ///< the one on the way through the whole piece
    PhaseValues current_a{};  ///< of the terminals, at its start; at its end once that is known
    bool plain = false;       ///< every terminal conducts at a constant voltage, nothing is shorted
    bool open = false;        ///< no terminal is driven, none carries a current
    bool stays = false;       ///< either of them, and the next piece has the same
    TerminalSet off = 0;      ///< terminals without a current
    // With a switched inverter, or with a break input:
    Connection connection{};
    double switch_ohm = 0.0;     ///< in series with each driven terminal
    bool has_switching = false;  ///< turning_on or watched: one of them may end the piece
    TerminalSet turning_on = 0;  ///< terminals whose diodes begin to conduct where they pass a rail
    bool floats_alone = false;   ///< and no terminal of the star is held
    bool knows_end = false;      ///< end_v has been asked for
    PhaseValues end_v{};         ///< with turning_on: the terminals where the piece has come to
    TerminalSet turns_on = 0;    ///< terminals that may have begun where the piece before ended
    int turn_ons = 0;            ///< such ends since the last end of a substep or edge
    bool watched = false;        ///< by the break input
    TerminalSet begun = 0;       ///< terminals whose diodes begin with the piece, from no current at all,
    TerminalSet rising = 0;      ///< and those of them whose currents start in the direction of the diode
  };

  /// The part of a piece up to its first event.
  struct Cut {
    double fraction = 1.0;
    int electrical_event = -1;  ///< the one of terminals and emf that ends it; negative: none does
    Freed freed{};              ///< by an event of the shaft
  };

  /// A piece of a tick from end to end.
  struct Passed {
    double start_s;
    double duration_s;
    const State& from;
    const State& to;
    const RotorMotion& from_motion;
    const RotorMotion& to_motion;
  };

  /// What those who follow the terminals through a piece are told.
  struct Followed {
    RotorMotion halfway;  ///< middle_motion(), where a comparator or the tap asks for a floating terminal
    PhaseValues last_v;   ///< of all terminals at its end, before its event
    PhaseValues end_v;    ///< after it
  };

  /// What GateSums integrates, at one instant of a piece.
  struct Instant {
    ThreePhase current_a;
    double link_a;
    double electrical_w;
    double torque_nm;
    double shaft_w;
    double copper_w;
  };

  static State machine_of(const AxisState& state) noexcept;
  static void keep_machine(AxisState& state, const State& x) noexcept;
  static Shaft shaft_of(const AxisState& state) noexcept;
  static void keep_shaft(AxisState& state, const Shaft& x) noexcept;

  RotorMotion turned(RotorMotion motion) const noexcept {
    if constexpr (Machine::kUsesAngle) motion.electrical = cos_sin(pole_pairs_ * motion.angle_rad);
    return motion;
  }
  /// The electrical angle is worked out now and then and rotated from there on: a third of the time of a
  /// cosine and sine, and more exact than carrying them as states.
  RotorMotion motion_of(const Whole& x) const noexcept {
    RotorMotion motion{
        .angle_rad = x.shaft.angle_rad, .speed_rad_s = x.shaft.speed_rad_s, .electrical = {1.0, 0.0}};
    if constexpr (Machine::kUsesAngle) {
      motion.electrical = rotated(near_, pole_pairs_ * (x.shaft.angle_rad - near_rad_));
    }
    return motion;
  }

  Whole slope(const AxisCore& core, const Whole& x, const TerminalInput& u, const ShaftBranch& branch,
              double load_nm) const noexcept;
  // Left to themselves the compilers call the slope four times, at twice the time.
  [[gnu::flatten]] void step(const AxisCore& core, Whole& x, double duration_s, const ShaftBranch& branch,
                             double load_nm) const noexcept;
  [[gnu::noinline]] void step_varying(const AxisCore& core, Whole& x, double duration_s,
                                      const ShaftBranch& branch, double load_nm) const noexcept;
  [[gnu::noinline]] void step_behind_switches(const AxisCore& core, Whole& x, double duration_s,
                                              const ShaftBranch& branch, double load_nm) const noexcept;
  /// The input of the windings with what the closed switches take.
  TerminalInput input_behind_switches(Connection connection, const State& x,
                                      const RotorMotion& motion) const noexcept;
  /// The same voltages with those that the closed switches have on the side of the link.
  PhaseValues before_switches(Connection connection, PhaseValues voltage_v) const noexcept;
  /// The voltages of the terminals at both ends of the piece and in its mean.
  void take_switch_voltages(Connection connection, const PhaseValues& from_a,
                            const PhaseValues& to_a) noexcept;
  /// Whether the instant at which a diode begins to conduct is an event.
  static bool watches_diodes(const AxisCore& core) noexcept {
    return core.p.drive.kind == DriveKind::kSwitched;
  }
  /// What the piece has to watch beside the currents that die.
  [[gnu::noinline]] void watch_switching(const AxisCore& core, const AxisState& state) noexcept;
  /// The terminals at the start of the piece, where this is the state of the machine.
  PhaseValues first_v(const AxisCore& core, const State& x, const RotorMotion& motion) const noexcept {
    return piece_.open || piece_.floats_alone ? floating_within(core, x, motion) : piece_.circuit.start_v;
  }
  /// The terminals where the piece has come to this state of the machine.
  PhaseValues floating_within(const AxisCore& core, const State& x, const RotorMotion& motion) const noexcept;
  /// Diodes that begin to conduct, and currents at the limit of the break input.
  /// `terminal_v` are the terminals in this state.
  [[gnu::noinline]] void add_switching(const AxisCore& core, const AxisState& state, const State& x,
                                       const RotorMotion& motion, const PhaseValues& terminal_v,
                                       EventValues& values) const noexcept;
  /// The number of events of terminals and emf before those of diodes that begin to conduct,
  int first_turn_on_event() const noexcept;
  /// and before those of the break input.
  int first_break_event() const noexcept;
  /// What has ended the piece, for the next one.
  void note_turn_on(int electrical_event) noexcept;
  /// The diodes that begin with the piece, from this state of the machine.
  void note_begun(const AxisCore& core, const AxisState& state, const State& x,
                  const RotorMotion& motion) noexcept;
  /// The dying currents at the start of the piece as values of events, where its end has these: a current
  /// that starts from zero and has turned against its diode stands there as if it came from its mirror image.
  PhaseValues dying_at_start(const PhaseValues& end_a) const noexcept;
  /// A diode that has begun with the piece and has a current against its direction at its end has none: its
  /// rail has moved on.
  [[gnu::noinline]] void stop_backward(const AxisCore& core, AxisState& state, State& x,
                                       const RotorMotion& motion) const noexcept;
  void forget_turn_ons() noexcept {
    piece_.turns_on = 0;
    piece_.turn_ons = 0;
  }
  /// Makes it a circuit of constant voltages in which no current dies.
  void hold_constant(const TerminalInput& input) noexcept;
  void drive_windings(const AxisCore& core, const ThreePhase& terminal_v) noexcept;
  /// Whether every terminal conducts; if so, the circuit has its voltage.
  bool conduct(const AxisCore& core, const AxisState& state) noexcept;
  /// The voltages of open windings where `u` lets the others carry current: in most machines those without
  /// any current, else the machine has floating_voltages().
  WindingValues floating_v(const State& x, const RotorMotion& motion, const TerminalInput& u) const noexcept;
  /// The same with all terminals open.
  WindingValues open_v(const State& x, const RotorMotion& motion) const noexcept;
  /// Whether terminals of which none is driven and none carries a current stay so.
  bool leave_open(const AxisCore& core, const State& x, const RotorMotion& motion) noexcept;
  void connect_piece(AxisCore& core, AxisState& state, double start_s, double duration_s, const State& x,
                     const RotorMotion& motion) noexcept;
  /// The step up to the event that comes first. kSwitching: add_switching() has events, too.
  template <bool kSwitching>
  Cut cut_at_event(AxisCore& core, AxisState& state, const Whole& from, Whole& to, double start_s,
                   double duration_s, const ShaftBranch& branch, double load_nm) noexcept;
  /// The distances to events. `current_a` are the terminals' currents, or dying_at_start().
  EventValues values_at(const AxisCore& core, TerminalSet dying, const PhaseValues& current_a, const Whole& x,
                        const ShaftBranch& branch, double load_nm, double corner) const noexcept;
  void add_electrical(TerminalSet dying, const PhaseValues& current_a, const RotorMotion& motion,
                      double corner, EventValues& values) const noexcept;
  double corner_between(const RotorMotion& from, const RotorMotion& to) const noexcept;
  /// The voltages of a shorter piece from the same start, if they depend on its length. The terminals that
  /// conduct and the events that are looked for stay those of the whole piece: where a link that moves would
  /// change them, so do the voltages.
  void reconnect_piece(AxisCore& core, AxisState& state, double start_s, double duration_s, const State& x,
                       const RotorMotion& motion) noexcept;
  void settle_terminals(const AxisCore& core, AxisState& state, State& x, const RotorMotion& motion,
                        int electrical_event) const noexcept;
  void begin_substep(const Shaft& shaft) noexcept;
  void look_up_angle(const Shaft& shaft) noexcept;
  /// Whether the circuit is that of the last piece but for the switches.
  bool goes_on(AxisCore& core, AxisState& state, double start_s, const Whole& x) noexcept;
  /// A piece without events, of which drive, sensors and thermal model need only the end.
  void run_smooth(AxisCore& core, Whole& x, double start_s, double end_s, double load_nm) noexcept;
  void run_piece(AxisCore& core, AxisState& state, Whole& x, double start_s, double end_s,
                 double load_nm) noexcept;
  void finish_piece(AxisCore& core, AxisState& state, const Passed& passed) noexcept;
  /// The terminals against the negative rail during the piece: for comparators, and in the mean voltages.
  [[gnu::noinline]] void follow_terminals(const AxisCore& core, AxisState& state, const Passed& passed,
                                          const Followed& followed) const noexcept;
  /// Terminals without a current that no switch holds. One driven terminal of a star alone carries no current
  /// and does not float.
  TerminalSet floating_terminals(const AxisCore& core) const noexcept {
    return piece_.off & ~driven_terminals(core.connection, piece_.drive);
  }
  /// Whether after its end the circuit is that of the piece, whose terminals are at `last_v` there: none has
  /// lost its current, and no diode begins to conduct.
  bool keeps_circuit(const AxisCore& core, const AxisState& state, const PhaseValues& last_v) const noexcept;
  /// The piece in its middle, by the values at its ends.
  State middle_of(const Passed& passed) const noexcept;
  RotorMotion middle_motion(const Passed& passed) const noexcept;
  PhaseValues middle_v() const noexcept;
  /// The voltages of all terminals where the piece has come to this state of the machine.
  PhaseValues within_piece_v(const AxisCore& core, TerminalSet floating, const State& x,
                             const RotorMotion& motion, const PhaseValues& driven_v) const noexcept;
  Instant instant_of(const AxisCore& core, const State& x, const RotorMotion& motion,
                     const PhaseValues& current_a, const PhaseValues& voltage_v) const noexcept;
  /// A piece of known currents into GateTap::sums, the terminals' voltages aside. `halfway` is its
  /// middle_motion().
  [[gnu::noinline]] void add_sums(const AxisCore& core, const Passed& passed, RotorMotion halfway,
                                  const PhaseValues& from_a) const noexcept;
  /// Currents that have died, into GateTap::events.
  [[gnu::noinline]] void tell_deaths(const AxisCore& core, TerminalSet died, double at_s) const noexcept;
  void end_run(const AxisCore& core, AxisState& state, const State& x, const RotorMotion& motion) noexcept;
  /// Sets blocked currents to zero again, from which rounding lets them drift.
  void keep_open(const AxisCore& core, const AxisState& state, State& x,
                 const RotorMotion& motion) const noexcept;
  /// Of the terminals, at the end of the last piece.
  PhaseValues end_voltages(const AxisCore& core, const AxisState& state, const State& x,
                           const RotorMotion& motion) const noexcept;
  PhaseValues currents(const AxisCore& core, const AxisState& state, const State& x,
                       const RotorMotion& motion) const noexcept;
  Measurable measurable(const AxisCore& core, const AxisState& state, const State& x,
                        const RotorMotion& motion, const PhaseValues& current_a,
                        const PhaseValues& voltage_v) const noexcept;

  typename Machine::Constants c_{};
  double pole_pairs_ = 0.0;
  Piece piece_{};
  CosSin near_{1.0, 0.0};  ///< of the electrical angle
  double near_rad_ = 0.0;  ///< of the rotor
};

/// A corner that is not within reach.
inline constexpr double kNoCorner = 1e300;

/// The integer that a corner position passes on its way between two values; kNoCorner if it passes none.
double corner_on_the_way(double from, double to) noexcept;

/// The n-th terminal of a set, from 0 on.
int nth_terminal(TerminalSet set, int n) noexcept;

/// The set of open terminals after the current of one has died; in a star the last two die together.
TerminalSet opened(Connection connection, TerminalSet open, int terminal) noexcept;

/// An interval has passed: drive, analog sensors and terminal voltages follow.
void follow_piece(AxisCore& core, AxisState& state, double start_s, double duration_s,
                  const TerminalDrive& drive, const TerminalCircuit& circuit, const Measurable& from,
                  const Measurable& to) noexcept;

}  // namespace drivebench
