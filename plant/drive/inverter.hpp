#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "plant/drive/amplifier.hpp"
#include "plant/drive/phases.hpp"
#include "plant/drive/terminal_drive.hpp"
#include "protocols/signals/command.hpp"

namespace drivebench {

/// Section [axis.inverter]: a bridge with symmetric (centre-aligned) PWM, averaged or switched. A star hangs
/// on three legs; each winding of the other connections hangs between the two legs of a bridge of its own,
/// which switch together (bipolar PWM), so that a winding is at plus or minus the whole link.
struct InverterParameters {
  int pwm_periods_per_tick = 1;
  double dead_time_s = 0.0;       ///< at each commutation both switches are open for so long
  double dead_time_band_a = 0.1;  ///< averaged: within it the dead-time error goes linearly through zero
  // Switched:
  double switch_ohm = 0.0;            ///< R_ds(on) of a closed switch, in both directions of the current
  double diode_v = 0.0;               ///< forward voltage V_f of a diode, whatever its current
  double bootstrap_s = 0.0;           ///< so long a full supply keeps an upper switch closed; 0: for ever
  double bootstrap_recharge_s = 0.0;  ///< so long a lower switch takes to fill an empty one
  // Both:
  double break_current_a = 0.0;  ///< a phase current beyond it, either sign, opens all legs; 0: none does
  double break_delay_s = 0.0;    ///< from that, or from the fault line, until the legs are open
};

/// The mean voltages that the bridge can give. A star may have two thirds of the link between a terminal and
/// its neutral: beyond a line-to-line voltage of the whole link the vector is shortened and keeps its angle
/// (hexagon limit); then the terminals are shifted in common to the middle of the link (min-max injection).
/// Other connections: each winding within plus and minus the link.
LimitedVoltages bridge_voltages(Connection connection, double bus_v, const ThreePhase& wanted_v) noexcept;

/// The voltages of duties as parts of the rail, -1 to 1: a star's leg with duty 0 is at the lower rail, and
/// the middle of the link is half way between the rails.
constexpr PhaseValues parts_of_rail(Connection connection, const PhaseValues& duties) noexcept {
  if (connection != Connection::kStar) return duties;
  return {
      .a = 2.0 * duties.a - 1.0, .b = 2.0 * duties.b - 1.0, .c = 2.0 * duties.c - 1.0, .field = duties.field};
}

/// Part of the period during which a terminal is at the upper rail, for a mean voltage within the rails.
/// Pulses and gaps that would vanish in the dead time, a part of the period, are left out: 0 or 1.
constexpr double duty(double voltage_v, double rail_v, double dead_part) noexcept {
  const double on = rail_v > 0.0 ? 0.5 + 0.5 * (voltage_v / rail_v) : 0.5;
  const double shortest = dead_part < 0.5 ? dead_part : 0.5;
  if (on <= shortest) return 0.0;
  return on >= 1.0 - shortest ? 1.0 : on;
}

/// Mean over a PWM period of the voltage of a terminal for its mean command. During the dead time the current
/// flows through the diode of the rail that it comes from:
///   error = -sign(i) 2 U_rail t_dead/T_pwm        if the terminal switches at all
/// which is U_bus t_dead/T_pwm for a leg of a star and twice that for a winding between two legs.
double averaged_voltage_v(double voltage_v, double rail_v, double dead_part, double current_a,
                          double band_a) noexcept;

/// Of a pattern: those between the commutations of three terminals, which may be two for each edge and for
/// what the tick before has left.
inline constexpr std::size_t kMaxSegmentsOfPattern = 3 * 2 * (kMaxLegEdges + 1) + 1;

/// The lists of a tick and of the two before it, which tell where the legs are when it starts.
struct EdgeHistory {
  LegEdges now{};
  LegEdges before{};
  LegEdges earlier{};
};

/// The commutations of the terminals within one PWM period, or by edges within a tick. By voltages each
/// on-interval and each dead time is centred on the ideal instant, so that what is at the start of the period
/// is there at its end. A terminal that stays at the upper rail for a whole period leaves it at the period's
/// end without a dead time.
class SwitchingPattern {
 public:
  /// The voltages are within the rails. Both switches of the legs in `legs_off`, bit 0 for a, stay open.
  void set_voltages(const ThreePhase& voltage_v, int terminals, double rail_v, double dead_time_s,
                    double period_s, std::uint32_t legs_off = 0) noexcept;

  /// By the edges of a tick of period_s. A switch closes dead_time_s after the other one of its leg has
  /// opened, if that is later than its edge, and not at all if the next edge comes before. Both switches of
  /// the legs in `legs_off` stay open.
  void set_edges(const EdgeHistory& edges, int terminals, double dead_time_s, double period_s,
                 std::uint32_t legs_off = 0) noexcept;

  /// Legs that stay at one level each; kNone is off.
  void set_levels(const LegLevels& levels, int terminals) noexcept;

  /// The segment between two commutations in which this instant of the period lies. The search starts at
  /// `hint`, which speeds it up and changes nothing.
  std::size_t segment_at(double instant_s, std::size_t hint) const noexcept {
    if (hint >= segments_.size()) hint = 0;
    hint += segments_[hint].until_s <= instant_s ? 1U : 0U;  // mostly none or one: without a branch
    while (hint > 0 && segments_[hint - 1].until_s > instant_s)
      --hint;
    while (segments_[hint].until_s <= instant_s)
      ++hint;
    return hint;
  }

  /// The commutation that ends a segment; beyond the period after the last one.
  double end_s(std::size_t segment) const noexcept { return segments_[segment].until_s; }

  /// The connection of the first `terminals` during a segment.
  void put(std::size_t segment, int terminals, double rail_v, TerminalDrive& out) const noexcept {
    const std::uint64_t passed = segments_[segment].passed;
    for (int k = 0; k < terminals; ++k) {
      const std::uint64_t of_terminal = passed >> (kBits * static_cast<std::uint64_t>(k)) & 7U;
      out.mode[static_cast<std::size_t>(k)] = kMode[of_terminal];
      phase(out.start_v, k) = kLevel[of_terminal] * rail_v;
    }
  }

 private:
  static constexpr double kNever = 1e300;
  static constexpr std::uint64_t kBits = 3;  ///< for the commutations that a terminal has passed: 0 to 4
  static constexpr std::uint64_t kLow = 0;   ///< of them leave the lower switch closed
  static constexpr std::uint64_t kHigh = 2;  ///< make the upper switch closed
  static constexpr std::uint64_t kOff = 5;   ///< in place of their number: the leg is off

  static constexpr std::uint64_t code_of(LegLevel level) noexcept {
    return level == LegLevel::kHigh ? kHigh : (level == LegLevel::kLow ? kLow : kOff);
  }

  // The connection of a terminal after so many commutations: lower switch, dead time, upper switch, dead
  // time, lower switch; then that of a leg that is off.
  static constexpr std::array<TerminalMode, 8> kMode{TerminalMode::kDriven, TerminalMode::kDiodes,
                                                     TerminalMode::kDriven, TerminalMode::kDiodes,
                                                     TerminalMode::kDriven, TerminalMode::kDiodes};
  static constexpr std::array<double, 8> kLevel{-1.0, 0.0, 1.0, 0.0, -1.0, 0.0};

  struct Segment {
    double until_s = kNever;
    std::uint64_t passed = 0;  ///< kBits for each terminal
  };
  std::array<Segment, kMaxSegmentsOfPattern> segments_{};
};

}  // namespace drivebench
