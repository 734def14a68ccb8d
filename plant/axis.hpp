#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "plant/amplifier.hpp"
#include "plant/current_sensor.hpp"
#include "plant/encoder.hpp"
#include "plant/faults.hpp"
#include "plant/machines/induction_machine.hpp"
#include "plant/mechanics.hpp"

namespace drivebench {

/// Everything that describes one emulated drive train.
struct AxisParameters {
  InductionMachineParameters machine;
  ShaftParameters mechanics;
  AmplifierParameters amplifier;
  EncoderParameters encoder;
  CurrentSensorParameters current_sensor;
};

/// How an axis is stepped; the same for its whole life.
struct AxisTiming {
  double period_s = 0.0;  ///< T
  int substeps = 1;       ///< integration steps per tick, at most kMaxSubsteps
};

inline constexpr int kMaxSubsteps = 32;

/// The continuous state, integrated as one vector.
struct DriveState {
  InductionMachineState machine;
  ShaftState shaft;
};

/// All that an axis remembers between ticks. 8-byte members only: it is saved, restored and hashed as words.
struct AxisState {
  DriveState drive;
  std::int64_t turns = 0;  ///< whole turns; the angle of the shaft is within one turn
  EncoderState encoder;
  LoadTorque load;
  TwoPhase voltage_v{};      ///< at the terminals at the end of the last tick
  std::uint64_t faults = 0;  ///< of the last tick, with the latched ones
};

/// What the sensors of an axis say at a tick, and the truth beside it.
struct AxisSample {
  TwoPhase current_a{};  ///< measured
  std::int64_t encoder_count = 0;
  std::uint32_t encoder_levels = 0;
  double edge_age_s = 0.0;
  double edge_period_s = 0.0;
  std::int64_t index_count = 0;
  Tick index_tick = -1;
  TwoPhase voltage_v{};  ///< at the terminals at the end of the last tick
  std::uint64_t faults = 0;
  double angle_rad = 0.0;  ///< true angle since the start
  double speed_rad_s = 0.0;
  double torque_nm = 0.0;
  double load_nm = 0.0;
  TwoPhase true_current_a{};
  TwoPhase rotor_flux_wb{};
  double bus_voltage_v = 0.0;
};

/// One emulated drive train: amplifier, induction machine, shaft, load, encoder and current sensors.
class Axis {
 public:
  /// The parameters must be free of problems().
  Axis(const AxisParameters& p, AxisTiming timing, std::uint64_t seed, std::uint64_t index) noexcept;

  /// Integrates one tick from `tick` to `tick` + 1 under the command.
  void advance(const PhaseCommand& command, Tick tick) noexcept;

  /// The sensors at the start of `tick`, after the advance that led there. A pure function of state and tick.
  AxisSample sample(Tick tick) const noexcept;

  /// Changes parameters while running; they hold from the next advance on.
  void set_parameters(const AxisParameters& p) noexcept;
  const AxisParameters& parameters() const noexcept { return p_; }

  const AxisState& state() const noexcept { return state_; }
  void restore(const AxisState& state) noexcept {
    state_ = state;
    segment_count_ = 0;
  }

  void set_load(double target_nm, Tick tick, Tick ramp_ticks) noexcept {
    state_.load.go_to(target_nm, tick, ramp_ticks);
  }
  void latch(std::uint64_t faults) noexcept { state_.faults |= faults; }
  void clear_faults() noexcept { state_.faults &= ~kLatchedFaults; }

  /// The shaft during the last tick, for Encoder::for_each_edge.
  std::span<const AngleSegment> last_tick() const noexcept { return {segments_.data(), segment_count_}; }
  std::int64_t last_tick_turn() const noexcept { return last_tick_turn_; }
  std::int64_t last_tick_count() const noexcept { return last_tick_count_; }  ///< at its start
  const Encoder& encoder() const noexcept { return encoder_; }
  const AxisTiming& timing() const noexcept { return timing_; }

 private:
  /// What holds between two events: phases that conduct, friction direction.
  struct Branch {
    TerminalInput terminals;
    FrictionBranch friction;
  };

  Branch branch_at(const DriveState& x, const PhaseCommand& command, TwoPhase voltage_v,
                   double load_nm) const noexcept;
  DriveState integrated(const DriveState& x, double duration_s, const Branch& branch,
                        double load_nm) const noexcept;
  void substep(double start_s, double duration_s, const PhaseCommand& command, TwoPhase voltage_v,
               double load_nm) noexcept;
  void record_segment(double start_s, double duration_s, const ShaftState& from,
                      const ShaftState& to) noexcept;
  void wrap_angle() noexcept;
  bool finite() const noexcept;

  // A substep splits at each event (a phase current or the speed reaching zero), at most this often.
  static constexpr std::size_t kMaxEvents = 4;

  AxisParameters p_;
  InductionMachineConstants machine_;
  Encoder encoder_;
  AxisTiming timing_;
  double step_s_;
  std::uint64_t seed_;
  std::uint64_t noise_channel_;
  bool has_dry_friction_;
  AxisState state_;
  std::array<AngleSegment, kMaxSubsteps*(kMaxEvents + 1)> segments_{};
  std::size_t segment_count_ = 0;
  std::int64_t last_tick_turn_ = 0;
  std::int64_t last_tick_count_ = 0;
};

}  // namespace drivebench
