#pragma once

#include <cstddef>
#include <cstdint>

#include "clients/identification/data/measured_data.hpp"
#include "clients/identification/data/result.hpp"
#include "clients/identification/data/signals.hpp"
#include "clients/identification/math/filters.hpp"

namespace drivebench::identification {

enum class MotorKind : std::uint8_t { kDc, kInduction, kPmSynchronous, kBldc };

/// The processing of data into equations. All terms of an equation should have passed the same filter and
/// belong to the same instant: a mismatch is the largest bias of all.
struct Processing {
  LowPass current{};  ///< of currents and what is derived from them
  LowPass voltage{};
  LowPass shaft{};            ///< of the angle, before its differences
  bool shaft_chosen = false;  ///< by choose_shaft_filter()
  /// Backward differences are late by half a period; they are here to show what that does.
  bool backward_differences = false;
  /// The advance of the voltages in periods. An amplifier of the bench, and many drives, report the mean of
  /// the period before the sample: 0.5. The bench reports the voltage of a line source at the sample itself:
  /// 0. Commands that arrive d periods late and hold for one: -d - 0.5.
  double voltage_shift = 0.5;
  double from_s = 0.0;  ///< part of the record that goes into the equations, from its first sample on; the
                        ///< filters see all
  double to_s = 0.0;    ///< 0: to the end
  std::size_t edge_samples = 20;  ///< left out at both ends of the record, where the filters have less data
};

/// The load that opposes the torque of an induction motor in the equation of motion.
enum class LoadModel : std::uint8_t { kViscous, kConstant };

/// The rotor of a PM synchronous motor.
enum class Rotor : std::uint8_t { kAsTheDataSay, kRound, kSalient };

/// Errors of the sensors that the refinement looks for beside the motor.
struct SensorSearch {
  bool current_offsets = false;
  bool voltage_offsets = false;  ///< in a star against phase a, as its terminals show no more
  bool zero = false;             ///< of the encoder, beside Settings::zero_rad
  bool gains = false;  ///< of the currents and of the voltages of the phases b and c against phase a
};

/// The input of identify() beside the data.
struct Settings {
  MotorKind kind = MotorKind::kInduction;
  int pole_pairs = 1;
  bool three_phase = true;  ///< star with phases a, b, c; else the two phases of a two-phase machine
  double counts_per_revolution = 0.0;  ///< > 0: the shaft is column encoder_count, else angle_rad
  bool half_count = true;              ///< takes the half count out by which a floor encoder is behind
  bool reversed = false;  ///< the shaft's angle falls while the motor turns from phase a to phase b
  double zero_rad = 0.0;  ///< added to the shaft's angle: the magnet points to phase a at zero
  LoadModel load = LoadModel::kViscous;
  bool two_stage = true;  ///< PM synchronous: first the electrical parameters, then the mechanical ones
  Rotor rotor = Rotor::kAsTheDataSay;  ///< one that is known saves the question: a third of the time
  SensorSearch sensors{};
  std::size_t most_samples = 100'000;  ///< that the refinement reads: keeps a long record below some seconds
  Processing processing{};
};

/// Filters that suit motors of this kind at this sampling rate, none above a fifth of the rate. The voltages
/// of an induction motor are taken as those of a line source, all others as those of an amplifier.
Processing usual_processing(MotorKind kind, double period_s);

/// The angle of the shaft as measured, in the direction of the phases and from their zero [rad].
Series measured_angle(const MeasuredData& data, const Settings& settings);

/// The angle of the shaft with its derivatives [rad, rad/s, rad/s^2].
struct ShaftSignals {
  Series angle;
  Series speed;
  Series acceleration;
};
ShaftSignals shaft_signals(const MeasuredData& data, const Settings& settings, const LowPass& filter);

/// Sets the corner of the shaft's filter from the counts of the encoder, the rate and the motion: the highest
/// one, up to the corner that is set, at which the counts leave a thousandth of the acceleration's variance
/// at most, so that they take no more than 0.1 % of the inertia; if there is none, the one with the smallest
/// share. A DC motor has its current and its speed in the same equations, so all of its filters get that
/// corner. An induction motor keeps what it has: its acceleration stands beside the second derivative of the
/// currents.
void choose_shaft_filter(const MeasuredData& data, Settings& settings);

/// Currents or voltages of the two-phase equivalent, as measured: "i", "_a" reads i_a_a, i_b_a, i_c_a.
TwoPhaseSeries windings(const MeasuredData& data, const Settings& settings, char quantity, char unit);

/// First and last + 1 sample that go into the equations; throws if there are fewer than 50.
struct SampleRange {
  std::size_t first;
  std::size_t end;
  std::size_t count() const noexcept { return end - first; }
};
SampleRange window_of(const MeasuredData& data, const Processing& processing);

/// Whether a signal varies enough in the window to tell what belongs to its derivative: by 0.2 % of its rms
/// value at least. An encoder leaves 0.02 % of noise on a steady speed, which has derivatives too.
bool varies(SeriesView x, const SampleRange& range);

/// Marks those of the named parameters that are no values for a motor, zero or less, as unseen.
void expect_positive(Result& result, const std::vector<std::string>& names);

/// The derivative as Processing has it.
Series slope_of(SeriesView x, const MeasuredData& data, const Processing& processing);

}  // namespace drivebench::identification
