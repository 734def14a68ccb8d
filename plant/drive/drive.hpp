#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

#include "plant/drive/amplifier.hpp"
#include "plant/drive/current_loop.hpp"
#include "plant/drive/inverter.hpp"
#include "plant/drive/supply/dc_bus.hpp"
#include "plant/drive/supply/source.hpp"
#include "plant/drive/supply/transformer.hpp"
#include "plant/drive/terminal_drive.hpp"
#include "plant/injected_faults.hpp"
#include "plant/tick.hpp"
#include "protocols/signals/command.hpp"

namespace drivebench {

/// The kind of circuit between the command and the terminals.
enum class DriveKind : std::int64_t {
  kVoltage,   ///< a linear voltage amplifier per phase
  kCurrent,   ///< the same under an inner current loop at every substep
  kAveraged,  ///< a bridge as its average over a PWM period
  kSwitched,  ///< a bridge resolved at its switching instants
  kSource,    ///< an AC or DC source behind a contactor; takes no commands
};

struct DriveParameters {
  DriveKind kind = DriveKind::kVoltage;
  AmplifierParameters amplifier;
  CurrentLoopParameters current_loop;
  InverterParameters inverter;
  BusParameters bus;
  SourceParameters source;
  TransformerParameters transformer;
};

/// In series with each winding of the machine: of the source itself and of its transformer.
struct SeriesImpedance {
  double resistance_ohm = 0.0;
  double inductance_h = 0.0;
};
SeriesImpedance series_impedance(const DriveParameters& p) noexcept;

/// Whether switches or diodes of the bridge take a voltage.
constexpr bool has_switch_losses(const DriveParameters& p) noexcept {
  return p.kind == DriveKind::kSwitched && (p.inverter.switch_ohm != 0.0 || p.inverter.diode_v != 0.0);
}

inline constexpr int kMaxDelayTicks = 8;           ///< of amplifier.delay_ticks
inline constexpr int kMaxInjectedDelayTicks = 16;  ///< of the fault command_delay

/// All that a drive remembers between two substeps. 8-byte members only.
struct DriveMemory {
  std::array<PhaseCommand, kMaxDelayTicks + kMaxInjectedDelayTicks + 2> commands{};  ///< a ring by tick
  ThreePhase filter_input_v{};                                                       ///< of the last interval
  ThreePhase filtered_v{};        ///< behind the output filter
  PhaseValues integral_v{};       ///< current loop
  double source_phase_rad = 0.0;  ///< of the source less phase_rad, within a turn, at the next begin_tick()
  double contactor_closed = 0.0;  ///< 0: open, or waiting for its angle
  StartCapacitor start_capacitor{};
  std::array<TransformerPhase, 3> transformer{};
  std::int64_t pwm_segment = 0;  ///< segment of the last at()
  double bus_v = 0.0;            ///< 0 with a source
  double chopper = 0.0;          ///< 1: the brake resistor is on
  double switched_off = 0.0;     ///< 1: tripped within this tick
  double saturated = 0.0;        ///< 1: a voltage was clipped in this tick
};

/// The drive of an axis. Within a tick the order is begin_tick(), then for every interval at() and finish();
/// an interval ends at a substep, at next_edge_s() or at an event of the machine, whichever comes first. at()
/// may be asked again for a shorter interval from the same start.
///
/// Gates::kOff lets the currents flow through the diodes into the rails; Gates::kZeroVoltage drives every
/// terminal at 0; Gates::kCurrent without a current loop is Gates::kOff. Gates::kDuty gives every leg its
/// voltage alone: an inverter then neither shortens the vector of a star nor moves its common part.
/// Gates::kEdges switches the legs of a switched inverter at the instants of the command; other drives have
/// their gates off then. A leg
/// that the command switches off is on its diodes, whatever the gates of the others do. Commands before tick
/// 0 are Gates::kOff. The field winding has the voltage source.field_v, if that is not 0, whatever the gates
/// do; else the command's, which is 0 with the gates off.
class Drive {
 public:
  /// The parameters must be free of problems(). Noise channels from noise_channel to noise_channel + 4 are
  /// used.
  Drive(const DriveParameters& p, Connection connection, double period_s, std::uint64_t seed,
        std::uint64_t noise_channel) noexcept;
  void set_parameters(const DriveParameters& p) noexcept;

  /// A drive at rest: the bus at its voltage, the contactor as configured.
  DriveMemory initial() const noexcept;

  void begin_tick(DriveMemory& m, const PhaseCommand& command, const InjectedFaults& faults,
                  Tick tick) noexcept;

  /// A link without a capacitor has the voltage of its supply, as the last begin_tick() knew it.
  void take_stiff_link(DriveMemory& m) const noexcept;

  /// Switches the gates off (a source: opens the contactor) for the rest of the tick: over-current trip. Call
  /// it after each begin_tick() while the trip lasts: delayed commands and contactors do not depend on it.
  void switch_off(DriveMemory& m) noexcept;

  /// The next instant after start_s, from the start of the tick, at which the voltages jump or bend; infinity
  /// if there is none within the tick. Instants closer than a billionth of the tick are one.
  double next_edge_s(const DriveMemory& m, double start_s) const noexcept {
    return has_edges_ ? edge_after(m, start_s) : std::numeric_limits<double>::infinity();
  }

  /// The state of the terminals from start_s on for duration_s, which crosses no edge. `current_a` are the
  /// terminal currents at start_s.
  TerminalDrive at(DriveMemory& m, double start_s, double duration_s,
                   const PhaseValues& current_a) const noexcept {
    if (steady_ && m.switched_off == 0.0) {
      TerminalDrive out = steady_output_;
      if (switches_) put_switches(m, orders_[1], start_s, out);
      return out;
    }
    return kind_ == DriveKind::kSource ? source_output(m, start_s, duration_s, current_a)
                                       : bridge_output(m, start_s, duration_s, current_a);
  }

  /// An interval has been integrated: energy and charge for bus, filter and capacitor. `voltage_v` are the
  /// mean terminal voltages, `from_a` and `to_a` the terminal currents at its ends.
  void finish(DriveMemory& m, double start_s, double duration_s, const TerminalDrive& applied,
              const PhaseValues& voltage_v, const PhaseValues& from_a,
              const PhaseValues& to_a) const noexcept {
    if (follows_) follow(m, start_s, duration_s, applied, voltage_v, from_a, to_a);
  }

  /// Instead of at() and finish(): from here on in this tick the terminals are those of a drive that this
  /// machine shares with another one, with constant voltages. A wire that breaks is this machine's own.
  void share_output(const TerminalDrive& out) noexcept;

  /// From here on in this tick the legs of a switched inverter are at these levels, whatever the command
  /// says. Faults that hold a terminal, and switch_off(), go before.
  void hold_legs(DriveMemory& m, const LegLevels& levels) noexcept;

  /// From here on the upper switches of these legs, bit 0 for a, stay open: their drivers have no supply.
  void starve(std::uint64_t legs) noexcept { starved_ = legs; }
  /// The switches that are closed from this instant on, those of a switched inverter; kOff is none of the
  /// leg.
  LegLevels closed_switches(DriveMemory& m, double start_s) const noexcept;

  /// Whether at() gives the same during what is left of the tick, whatever the machine does.
  bool steady(const DriveMemory& m) const noexcept { return steady_ && !switches_ && m.switched_off == 0.0; }
  /// Whether at() changes during what is left of the tick by the switches alone: see switch_terminals().
  bool only_switches(const DriveMemory& m) const noexcept {
    return steady_ && switches_ && m.switched_off == 0.0;
  }
  /// Brings an output of at() up to date where only_switches() holds. Whether anything has switched.
  bool switch_terminals(DriveMemory& m, double start_s, TerminalDrive& out) const noexcept;
  /// Whether finish() has something to do in this tick.
  bool follows() const noexcept { return follows_; }

 private:
  /// The effect of a command in this tick.
  struct Order {
    Gates gates = Gates::kOff;  ///< kCurrent only with a current loop
    std::uint32_t legs_off = 0;
    /// [V] behind gain and offset, or [A] within the limit; duties as parts of the rail, -1 to 1.
    PhaseValues setpoint{};
    SwitchingPattern pattern{};  ///< switched inverter
    double origin_s = 0.0;       ///< Gates::kEdges: from which they count, within this tick or before it
  };
  /// A fault that holds a terminal whatever the command says.
  enum class Hold { kNone, kHigh, kLow, kOff, kOpen };

  // begin_tick
  void take_faults(const InjectedFaults& faults) noexcept;
  PhaseCommand corrupted(const PhaseCommand& command, double probability, Tick tick) const noexcept;
  void take_orders(DriveMemory& m, const InjectedFaults& faults, Tick tick) noexcept;
  void take_order(Order& order, const PhaseCommand& command, DriveMemory& m) const noexcept;
  /// The edges of the command of so many ticks ago, which count from origin_s.
  void take_edges(Order& order, const DriveMemory& m, Tick tick, Tick ago, double origin_s) const noexcept;
  void begin_source(DriveMemory& m) noexcept;

  // the tick
  double edge_after(const DriveMemory& m, double start_s) const noexcept;
  TerminalDrive bridge_output(DriveMemory& m, double start_s, double duration_s,
                              const PhaseValues& current_a) const noexcept;
  TerminalDrive source_output(const DriveMemory& m, double start_s, double duration_s,
                              const PhaseValues& current_a) const noexcept;
  /// The source's own voltages at a time after the start of an interval.
  ThreePhase source_v(double start_s, double time_s) const noexcept {
    return source_voltages(p_.source, source_, source_amplitude_v_, source_angle_at(start_s + time_s));
  }
  /// A table may jump at either end of an interval: its values there are those so far within.
  double inside_s_of(double duration_s) const noexcept {
    return p_.source.waveform == Waveform::kTable ? std::min(tolerance_s_, 0.5 * duration_s) : 0.0;
  }
  /// From the voltages of the primaries to those of the secondaries.
  void transform(const DriveMemory& m, double duration_s, const PhaseValues& current_a,
                 TerminalDrive& out) const noexcept;
  void follow(DriveMemory& m, double start_s, double duration_s, const TerminalDrive& applied,
              const PhaseValues& voltage_v, const PhaseValues& from_a,
              const PhaseValues& to_a) const noexcept;

  // their parts
  const Order& order_at(double start_s) const noexcept {
    return orders_[start_s + tolerance_s_ >= later_s_ ? 1 : 0];
  }
  double pwm_start_s(double start_s) const noexcept;
  /// The start of the pattern that is in force.
  double pattern_start_s(const Order& order, double start_s) const noexcept {
    return order.gates == Gates::kEdges ? order.origin_s : pwm_start_s(start_s);
  }
  double source_angle_at(double time_s) const noexcept {
    return source_angle_rad_ + 2.0 * std::numbers::pi * p_.source.frequency_hz * time_s;
  }
  static std::size_t segment_hint(const DriveMemory& m) noexcept {
    return static_cast<std::size_t>(m.pwm_segment);
  }
  bool is_inverter() const noexcept { return kind_ == DriveKind::kAveraged || kind_ == DriveKind::kSwitched; }
  double rail_v(const DriveMemory& m) const noexcept { return rail_voltage_v(m.bus_v, connection_); }
  double limit_v(const DriveMemory& m) const noexcept {
    return std::min(p_.amplifier.voltage_limit_v, rail_v(m));
  }
  PhaseValues loop_voltages(const DriveMemory& m, const PhaseValues& setpoint_a,
                            const PhaseValues& current_a) const noexcept;
  PhaseValues wanted_voltages(const DriveMemory& m, const Order& order,
                              const PhaseValues& current_a) const noexcept;
  LimitedVoltages limited(const DriveMemory& m, Gates gates, const ThreePhase& wanted_v) const noexcept;
  void drive_terminals(DriveMemory& m, const Order& order, double start_s, const PhaseValues& current_a,
                       TerminalDrive& out) const noexcept;
  void find_segment(DriveMemory& m, const Order& order, double start_s) const noexcept;
  void put_switches(DriveMemory& m, const Order& order, double start_s, TerminalDrive& out) const noexcept;
  ThreePhase with_dead_time(const ThreePhase& voltage_v, double rail_v,
                            const PhaseValues& current_a) const noexcept;
  void filter(DriveMemory& m, double duration_s, TerminalDrive& out) const noexcept;
  void open_legs(std::uint32_t legs_off, TerminalDrive& out) const noexcept;
  /// Puts the terminals of a switched inverter on the mean of a battery's link over the interval, if the
  /// currents stay: link and machine then agree to second order in the interval.
  void foresee_link(const DriveMemory& m, double duration_s, const PhaseValues& current_a,
                    TerminalDrive& out) const noexcept;
  void hold_terminals(TerminalDrive& out) const noexcept;
  void follow_start_capacitor(DriveMemory& m, double duration_s, const TerminalDrive& applied,
                              const PhaseValues& from_a, const PhaseValues& to_a) const noexcept;
  void follow_transformer(DriveMemory& m, double start_s, double duration_s, const TerminalDrive& applied,
                          const PhaseValues& from_a, const PhaseValues& to_a) const noexcept;
  void follow_filter(DriveMemory& m, double duration_s, const TerminalDrive& applied,
                     const PhaseValues& voltage_v) const noexcept;
  void follow_loop(DriveMemory& m, double start_s, double duration_s, const PhaseValues& from_a,
                   const PhaseValues& to_a) const noexcept;
  /// The voltages of the rails that the terminals hang on, without what switches and diodes take.
  PhaseValues link_side_v(const TerminalDrive& applied, const PhaseValues& voltage_v) const noexcept;
  void follow_bus(DriveMemory& m, double duration_s, const TerminalDrive& applied,
                  const PhaseValues& voltage_v, const PhaseValues& from_a,
                  const PhaseValues& to_a) const noexcept;

  DriveParameters p_;
  Connection connection_;
  DriveKind kind_;
  int terminals_;
  double period_s_;
  double tolerance_s_;  ///< instants closer than this are one
  double pwm_period_s_;
  double dead_part_;  ///< dead time over PWM period
  double diode_v_;    ///< between a terminal and a rail
  double switch_ohm_;
  double filter_rate_per_s_;
  SourceConstants source_;
  TransformerConstants transformer_;
  bool has_transformer_;
  bool foresees_link_;
  std::uint64_t seed_;
  std::uint64_t noise_channel_;

  // Of the tick that is running; begin_tick() makes all of it anew.
  std::array<Order, 2> orders_{};  ///< the second takes over at later_s_
  double later_s_ = 0.0;
  std::array<Hold, 3> hold_{};
  bool holds_ = false;  ///< any
  std::uint64_t starved_ = 0;
  bool field_lost_ = false;
  double supply_v_ = 0.0;  ///< of the bus
  double source_amplitude_v_ = 0.0;
  double source_angle_rad_ = 0.0;  ///< of phase a, at the start of the tick
  double closing_s_ = 0.0;         ///< from then on the contactor is closed
  bool has_corners_ = false;       ///< of the source, which are edges
  bool has_edges_ = false;
  bool follows_ = false;   ///< finish() has something to do
  bool steady_ = false;    ///< steady_output_ holds during the whole tick
  bool switches_ = false;  ///< but for the switches of orders_[1]
  TerminalDrive steady_output_{};
};

}  // namespace drivebench
