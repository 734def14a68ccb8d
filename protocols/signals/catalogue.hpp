#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

#include "protocols/signals/sample.hpp"

namespace drivebench {

/// The type of a signal, which is also its encoding.
enum class SignalType {
  kUnsigned,  ///< uint64 on the wire
  kSigned,    ///< sint64 (zigzag) on the wire
  kReal,      ///< double on the wire
};

/// Who may know a signal: a controller on a real bench sees status and sensors, never the truth.
enum class SignalKind { kStatus, kSensor, kTruth };

/// One row of the catalogue. The position of the row is the field number in message Sample, from 1.
struct Signal {
  std::string_view name;
  std::string_view unit;
  SignalType type;
  SignalKind kind;
  double minimum;  ///< of the usual range, for displays and scaled encodings
  double maximum;
  std::uint64_t Sample::*as_unsigned;
  std::int64_t Sample::*as_signed;
  double Sample::*as_real;
  std::string_view meaning;
};

namespace catalogue_detail {

constexpr double kAnyTick = 9.007199254740992e15;  // 2^53: what a double holds exactly

constexpr Signal status(std::string_view name, std::string_view unit, std::uint64_t Sample::*member,
                        double maximum, std::string_view meaning) {
  return {name,    unit,   SignalType::kUnsigned, SignalKind::kStatus, 0.0, maximum, member, nullptr,
          nullptr, meaning};
}
constexpr Signal status(std::string_view name, std::string_view unit, std::int64_t Sample::*member,
                        double maximum, std::string_view meaning) {
  return {name,    unit,   SignalType::kSigned, SignalKind::kStatus, -1.0, maximum, nullptr, member,
          nullptr, meaning};
}
constexpr Signal sensor(std::string_view name, std::string_view unit, std::int64_t Sample::*member,
                        double bound, std::string_view meaning) {
  return {name,    unit,   SignalType::kSigned, SignalKind::kSensor, -bound, bound, nullptr, member,
          nullptr, meaning};
}
constexpr Signal sensor(std::string_view name, std::string_view unit, std::uint64_t Sample::*member,
                        double maximum, std::string_view meaning) {
  return {name,    unit,   SignalType::kUnsigned, SignalKind::kSensor, 0.0, maximum, member, nullptr,
          nullptr, meaning};
}
constexpr Signal real(SignalKind kind, std::string_view name, std::string_view unit, double Sample::*member,
                      double minimum, double maximum, std::string_view meaning) {
  return {name, unit, SignalType::kReal, kind, minimum, maximum, nullptr, nullptr, member, meaning};
}

}  // namespace catalogue_detail

/// The signals of an axis, written once: wire encodings, recordings, exports, descriptions and displays loop
/// over this table. Two-phase quantities are power-invariant (a three-phase amplitude times sqrt(3/2)).
inline constexpr auto kSignals = [] {
  using namespace catalogue_detail;
  constexpr SignalKind kSensor = SignalKind::kSensor;
  constexpr SignalKind kTruth = SignalKind::kTruth;
  return std::to_array<Signal>({
      status("tick", "1", &Sample::tick, kAnyTick, "sample period; the sample is taken at its start"),
      status("command_tick", "1", &Sample::command_tick, kAnyTick,
             "tick of the sample that the command in force answered; -1: none"),
      status("command_age_ticks", "ticks", &Sample::command_age_ticks, 1e6,
             "ticks since the tick that the command in force answered"),
      status("missed_commands", "1", &Sample::missed_commands, kAnyTick,
             "ticks for which a controller owed a command and sent none"),
      status("refused_commands", "1", &Sample::refused_commands, kAnyTick,
             "commands that were turned away, and scheduled inputs that could not be carried out"),
      status("late_ticks", "1", &Sample::late_ticks, kAnyTick,
             "ticks of the bench that started after their time"),
      status("state", "enum", &Sample::state, 5, "0 idle, 1 run, 2 hold, 3 timeout, 4 fault, 5 ready"),
      status("faults", "bits", &Sample::faults, kAnyTick, "fault word; the description lists the bits"),
      status("owner", "1", &Sample::owner, kAnyTick, "session that holds the lease; 0: nobody"),
      sensor("encoder_count", "counts", &Sample::encoder_count, kAnyTick,
             "floor(theta N/(2 pi)), plus the offset"),
      sensor("encoder_levels", "bits", &Sample::encoder_levels, 63,
             "1 A, 2 B, 4 Z, 8 last edge counted down, 16 direction changed, 32 period valid"),
      real(kSensor, "edge_age_s", "s", &Sample::edge_age_s, 0, 3600,
           "time since the last edge; since tick 0 if none"),
      real(kSensor, "edge_period_s", "s", &Sample::edge_period_s, 0, 3600,
           "time between the last two edges; 0 until there were two"),
      sensor("index_count", "counts", &Sample::index_count, kAnyTick, "count latched when Z last rose"),
      sensor("index_tick", "1", &Sample::index_tick, kAnyTick, "tick in which Z last rose; -1: never"),
      real(kSensor, "i_a_a", "A", &Sample::i_a_a, -100, 100, "measured current of phase a, into the machine"),
      real(kSensor, "i_b_a", "A", &Sample::i_b_a, -100, 100, "measured current of phase b, into the machine"),
      real(kSensor, "u_a_v", "V", &Sample::u_a_v, -1000, 1000,
           "voltage at phase a at the end of the tick before"),
      real(kSensor, "u_b_v", "V", &Sample::u_b_v, -1000, 1000,
           "voltage at phase b at the end of the tick before"),
      real(kTruth, "angle_rad", "rad", &Sample::angle_rad, -1e6, 1e6, "true shaft angle since the start"),
      real(kTruth, "speed_rad_s", "rad/s", &Sample::speed_rad_s, -10000, 10000,
           "true speed, positive from a to b"),
      real(kTruth, "torque_nm", "N*m", &Sample::torque_nm, -1000, 1000, "torque of the machine on the shaft"),
      real(kTruth, "load_nm", "N*m", &Sample::load_nm, -1000, 1000,
           "load torque; positive opposes positive torque"),
      real(kTruth, "true_i_a_a", "A", &Sample::true_i_a_a, -100, 100, "true current of phase a"),
      real(kTruth, "true_i_b_a", "A", &Sample::true_i_b_a, -100, 100, "true current of phase b"),
      real(kTruth, "psi_a_wb", "Wb", &Sample::psi_a_wb, -10, 10, "rotor flux linkage, stator axis a"),
      real(kTruth, "psi_b_wb", "Wb", &Sample::psi_b_wb, -10, 10, "rotor flux linkage, stator axis b"),
      real(kSensor, "bus_voltage_v", "V", &Sample::bus_voltage_v, 0, 1000, "voltage of the DC link"),
      real(kSensor, "i_c_a", "A", &Sample::i_c_a, -100, 100, "measured current of phase c, into the machine"),
      real(kSensor, "i_f_a", "A", &Sample::i_f_a, -100, 100, "measured current of the field winding"),
      real(kSensor, "u_c_v", "V", &Sample::u_c_v, -1000, 1000,
           "voltage at phase c at the end of the tick before"),
      real(kSensor, "u_f_v", "V", &Sample::u_f_v, -1000, 1000, "voltage at the field winding"),
      real(kSensor, "u_n_v", "V", &Sample::u_n_v, -1000, 1000,
           "neutral of the motor against the middle of the DC link"),
      sensor("hall_lines", "bits", &Sample::hall_lines, 7, "Hall lines: 1 line 1, 2 line 2, 4 line 3"),
      real(kSensor, "tachometer_v", "V", &Sample::tachometer_v, -1000, 1000, "voltage of the tachometer"),
      real(kSensor, "resolver_sin_v", "V", &Sample::resolver_sin_v, -10, 10,
           "sine winding of the resolver, demodulated"),
      real(kSensor, "resolver_cos_v", "V", &Sample::resolver_cos_v, -10, 10,
           "cosine winding of the resolver, demodulated"),
      real(kSensor, "temperature_k", "K", &Sample::temperature_k, 0, 1000, "temperature of the windings"),
      real(kSensor, "meter_u_rms_v", "V", &Sample::meter_u_rms_v, 0, 1000,
           "power analyser, last whole window: rms voltage"),
      real(kSensor, "meter_i_rms_a", "A", &Sample::meter_i_rms_a, 0, 100, "power analyser: rms current"),
      real(kSensor, "meter_p_w", "W", &Sample::meter_p_w, -1e6, 1e6, "power analyser: active power"),
      real(kSensor, "meter_q_var", "var", &Sample::meter_q_var, -1e6, 1e6, "power analyser: reactive power"),
      real(kSensor, "meter_pf", "1", &Sample::meter_pf, -1, 1, "power analyser: power factor"),
      real(kTruth, "true_i_c_a", "A", &Sample::true_i_c_a, -100, 100, "true current of phase c"),
      real(kTruth, "true_i_f_a", "A", &Sample::true_i_f_a, -100, 100, "true current of the field winding"),
      real(kTruth, "load_angle_rad", "rad", &Sample::load_angle_rad, -1e6, 1e6,
           "true angle of the output: behind gear and elastic shaft"),
      real(kTruth, "load_speed_rad_s", "rad/s", &Sample::load_speed_rad_s, -10000, 10000,
           "true speed of the output"),
      real(kTruth, "load_position_m", "m", &Sample::load_position_m, -1000, 1000,
           "true position of the table on the screw"),
      status("injected", "bits", &Sample::injected, kAnyTick,
             "injected faults in force; the description lists the bits"),
  });
}();

static_assert(kSignals.size() == kSampleWords, "every member of Sample has one row");

/// The value as a double, for displays and exports of small integers.
constexpr double value_of(const Signal& signal, const Sample& sample) noexcept {
  switch (signal.type) {
    case SignalType::kUnsigned:
      return static_cast<double>(sample.*signal.as_unsigned);
    case SignalType::kSigned:
      return static_cast<double>(sample.*signal.as_signed);
    case SignalType::kReal:
      break;
  }
  return sample.*signal.as_real;
}

/// The row with this name, or null.
constexpr const Signal* find_signal(std::string_view name) noexcept {
  for (const Signal& signal : kSignals) {
    if (signal.name == name) return &signal;
  }
  return nullptr;
}

/// A set of signals: bit n is row n.
using SignalMask = std::uint64_t;
static_assert(kSignals.size() < 64);
inline constexpr SignalMask kAllSignals = (SignalMask{1} << kSignals.size()) - 1;

}  // namespace drivebench
