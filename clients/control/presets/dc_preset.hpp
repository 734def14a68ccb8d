#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <string_view>
#include <type_traits>

#include "clients/control/dc/dc_open_loop.hpp"
#include "clients/control/dc/dc_references.hpp"
#include "clients/control/dc/dc_state_feedback.hpp"
#include "clients/control/dc/dc_voltage_feedback.hpp"
#include "clients/control/math/limits.hpp"
#include "clients/control/presets/preset.hpp"
#include "clients/control/wound_dc/separate_dc_control.hpp"
#include "clients/control/wound_dc/series_dc_control.hpp"

/// The construction of the presets of DC machines, and the limits that are checked before a move.
namespace drivebench::control {

using DcDemands = std::array<Demand, 2>;

inline DcDemands dc_demands(double current_a, double current_limit_a, double voltage_v,
                            double voltage_limit_v) noexcept {
  return {{{.quantity = "armature current", .value = current_a, .limit = current_limit_a, .unit = "A"},
           {.quantity = "armature voltage", .value = voltage_v, .limit = voltage_limit_v, .unit = "V"}}};
}

/// Laws with the reference's own current or voltage in front: i_ref and v_ref of the move.
inline DcDemands demands_of(const DcAxisParameters& axis, const Reference& r) noexcept {
  return dc_demands(reference_current_a(axis.machine, r), axis.current_limit_a,
                    reference_voltage_v(axis.machine, r), axis.voltage_limit_v);
}

/// Torque (J·α + f·ω) at the flux of the reference.
inline DcDemands demands_of(const SeparateDcParameters& p, const Reference& r) noexcept {
  const WoundDcModel& m = p.axis.machine;
  const double per_a = m.motor_constant * p.flux.at(r).flux_wb;
  const double current_a = (m.inertia_kgm2 * r.acceleration_rad_s2 + m.friction_nms * r.speed_rad_s) / per_a;
  return dc_demands(current_a, p.axis.current_limit_a,
                    m.armature_resistance_ohm * current_a + per_a * r.speed_rad_s, p.axis.voltage_limit_v);
}

/// The same where the current makes the flux, unsaturated: torque = K_m·L_f·i².
inline DcDemands demands_of(const SeriesDcParameters& p, const Reference& r) noexcept {
  const WoundDcModel& m = p.axis.machine;
  const double torque_nm =
      std::max(0.0, m.inertia_kgm2 * r.acceleration_rad_s2 + m.friction_nms * r.speed_rad_s);
  const double per_square = m.motor_constant * m.flux_slope_h(0.0);
  const double current_a = std::sqrt(torque_nm / per_square);
  return dc_demands(
      current_a, p.axis.current_limit_a,
      (m.armature_resistance_ohm + m.field_resistance_ohm + per_square * r.speed_rad_s) * current_a,
      p.axis.voltage_limit_v);
}

/// Refuses a move that demands more than a limit. A law without the acceleration has no demand in advance.
template <class P>
void refuse_beyond_limits(const P& p, const Trajectory& move, double period_s) {
  const auto check = [&move, period_s](const auto& what) {
    refuse(first_exceeded(move.duration_s(), period_s,
                          [&](double t_s) { return demands_of(what, move.at(t_s)); }));
  };
  if constexpr (std::is_same_v<P, SeparateDcParameters> || std::is_same_v<P, SeriesDcParameters>) {
    check(p);
  } else if constexpr (std::is_same_v<P, DcOpenLoopParameters> ||
                       std::is_same_v<P, DcStateFeedbackParameters> ||
                       std::is_same_v<P, DcVoltageFeedbackParameters>) {
    check(p.axis);
  }
}

/// The signal that the controller measures beside counts and armature current.
template <class P>
constexpr std::string_view signal_of(const P& p) noexcept {
  if (p.axis.shaft.source == ShaftSpeed::kEdges) return "edge_age_s";
  if (p.axis.shaft.source == ShaftSpeed::kTachometer) return "tachometer_v";
  if constexpr (std::is_same_v<decltype(p.axis), WoundDcAxisParameters> &&
                !std::is_same_v<P, SeriesDcParameters>)
    return "i_f_a";
  return {};
}

template <class ControllerType, class Move, class P, class Path>
Run dc_run(const P& p, const Path& path, const RunTiming& timing) {
  auto move = std::make_shared<Move>(path);
  refuse_beyond_limits(p, *move, p.axis.period_s());
  return run_at(p.axis.sample_rate_hz, std::make_unique<ControllerType>(p), std::move(move), timing);
}

/// A preset of a controller and a move of these types.
template <class ControllerType, class Move, class P, class Path>
Preset dc_preset(const PresetText& text, std::string_view machine_kind, Quantity quantity, const P& p,
                 const Path& path, const RunTiming& timing) {
  return preset_of(text,
                   {.machine_kind = machine_kind,
                    .counts_per_revolution = p.axis.shaft.counts_per_revolution,
                    .pole_pairs = 0.0,
                    .voltage_limit_v = p.axis.voltage_limit_v,
                    .quantity = quantity,
                    .signal = signal_of(p)},
                   dc_run<ControllerType, Move, P, Path>, p, path, timing);
}

}  // namespace drivebench::control
