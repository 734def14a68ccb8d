// The source of a drive: contactor, transformer and starting capacitor.
#include <algorithm>

#include "plant/drive/drive.hpp"
#include "plant/drive/phases.hpp"
#include "plant/math/trig.hpp"

namespace drivebench {

void Drive::begin_source(DriveMemory& m) noexcept {
  const SourceParameters& source = p_.source;
  const double omega_rad_s = kTurnRad * source.frequency_hz;
  source_angle_rad_ = m.source_phase_rad + source.phase_rad;
  m.source_phase_rad = within_turn(m.source_phase_rad + omega_rad_s * period_s_);
  follows_ = source.start_capacitance_f > 0.0 || has_transformer_;
  closing_s_ = 0.0;
  if (!source.contactor) {
    m.contactor_closed = 0.0;
  } else if (m.contactor_closed == 0.0) {
    const double wait_s =
        source.choose_angle ? time_until_s(source.closing_angle_rad, source_angle_rad_, omega_rad_s) : 0.0;
    if (wait_s < period_s_ - tolerance_s_) {
      m.contactor_closed = 1.0;
      closing_s_ = wait_s;
    }
  }
  has_corners_ = has_corners(source, period_s_);
  has_edges_ = closing_s_ > tolerance_s_ || has_corners_;
  if (m.contactor_closed != 0.0 && !has_edges_ && !follows_) {
    steady_output_ = source_output(m, 0.0, period_s_, {});
    steady_ = steady_output_.constant;
  }
}

TerminalDrive Drive::source_output(const DriveMemory& m, double start_s, double duration_s,
                                   const PhaseValues& current_a) const noexcept {
  const SourceParameters& source = p_.source;
  TerminalDrive out;
  const double turns_ratio = has_transformer_ ? p_.transformer.turns_ratio : 1.0;
  out.rail_v = std::max(p_.amplifier.voltage_limit_v, 2.0 * turns_ratio * source.amplitude_v);
  out.field_v = field_lost_ ? 0.0 : source.field_v;
  if (m.contactor_closed == 0.0 || start_s + tolerance_s_ < closing_s_) {
    out.mode.fill(TerminalMode::kOpen);
    return out;
  }
  const double inside_s = inside_s_of(duration_s);
  const auto voltages = [&](double time_s) noexcept {
    ThreePhase v = source_v(start_s, std::clamp(time_s, inside_s, duration_s - inside_s));
    if (source.start_switch) {
      v.b = 0.0;
    } else if (source.start_capacitance_f > 0.0) {
      v.b = v.a - capacitor_drop_v(source, m.start_capacitor, current_a.b, time_s);
    }
    return v;
  };
  out.start_v = voltages(0.0);
  out.constant = source.frequency_hz == 0.0 && (source.start_capacitance_f == 0.0 || source.start_switch) &&
                 !has_transformer_;
  if (!out.constant) {
    out.middle_v = voltages(0.5 * duration_s);
    out.end_v = voltages(duration_s);
  }
  if (has_transformer_) transform(m, duration_s, current_a, out);
  if (holds_) hold_terminals(out);
  return out;
}

void Drive::transform(const DriveMemory& m, double duration_s, const PhaseValues& current_a,
                      TerminalDrive& out) const noexcept {
  ThreePhase i = phases_of(current_a);
  for (int k = 0; k < terminals_; ++k) {
    const Course primary_v = {phase(out.start_v, k), phase(out.middle_v, k), phase(out.end_v, k)};
    const Course v = secondary_course_v(transformer_, m.transformer[static_cast<std::size_t>(k)], primary_v,
                                        phase(i, k), duration_s);
    phase(out.start_v, k) = v.start;
    phase(out.middle_v, k) = v.middle;
    phase(out.end_v, k) = v.end;
  }
}

void Drive::follow_start_capacitor(DriveMemory& m, double duration_s, const TerminalDrive& applied,
                                   const PhaseValues& from_a, const PhaseValues& to_a) const noexcept {
  m.start_capacitor = applied.mode[1] == TerminalMode::kDriven && !p_.source.start_switch
                          ? charged(p_.source, m.start_capacitor, from_a.b, to_a.b, duration_s)
                          : StartCapacitor{.voltage_v = m.start_capacitor.voltage_v};
}

/// The primaries stay on the source when the contactor opens: the current of its arc is theirs, too.
void Drive::follow_transformer(DriveMemory& m, double start_s, double duration_s,
                               const TerminalDrive& applied, const PhaseValues& from_a,
                               const PhaseValues& to_a) const noexcept {
  ThreePhase from = phases_of(from_a);
  ThreePhase to = phases_of(to_a);
  const double inside_s = inside_s_of(duration_s);
  ThreePhase start_v = source_v(start_s, inside_s);
  ThreePhase middle_v = source_v(start_s, 0.5 * duration_s);
  ThreePhase end_v = source_v(start_s, duration_s - inside_s);
  for (int k = 0; k < terminals_; ++k) {
    const auto index = static_cast<std::size_t>(k);
    TransformerPhase& x = m.transformer[index];
    if (applied.mode[index] != TerminalMode::kDriven) x.current = {};
    const Course primary_v = {phase(start_v, k), phase(middle_v, k), phase(end_v, k)};
    x = magnetised(transformer_, x, primary_v, phase(from, k), phase(to, k), duration_s);
  }
}

}  // namespace drivebench
