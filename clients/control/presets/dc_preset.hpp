#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "clients/control/dc/dc_open_loop.hpp"
#include "clients/control/dc/dc_state_feedback.hpp"
#include "clients/control/dc/dc_voltage_feedback.hpp"
#include "clients/control/math/limits.hpp"
#include "clients/control/presets/preset.hpp"
#include "clients/control/wound_dc/separate_dc_control.hpp"
#include "clients/control/wound_dc/series_dc_control.hpp"

/// How the presets of DC machines are put together, and what is looked at before a move.
namespace drivebench::control {

using DcDemands = std::array<Demand, 2>;

inline DcDemands dc_demands(double current_a, double current_limit_a, double voltage_v,
                            double voltage_limit_v) noexcept {
  return {{{.quantity = "armature current", .value = current_a, .limit = current_limit_a, .unit = "A"},
           {.quantity = "armature voltage", .value = voltage_v, .limit = voltage_limit_v, .unit = "V"}}};
}

/// Laws with the reference's own current or voltage in front: i_ref and v_ref of the move.
inline DcDemands demands_of(const DcAxisParameters& axis, const Reference& r) noexcept {
  return dc_demands(axis.machine.current_a(r), axis.current_limit_a, axis.machine.voltage_v(r),
                    axis.voltage_limit_v);
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

/// Refuses a move that asks for more than there is. Laws that are not told the acceleration ask for nothing
/// in advance.
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

/// What the controller measures beside counts and armature current.
template <class P>
constexpr std::string_view signal_of(const P& p) noexcept {
  if (p.axis.shaft.source == ShaftSpeed::kEdges) return "edge_age_s";
  if (p.axis.shaft.source == ShaftSpeed::kTachometer) return "tachometer_v";
  if constexpr (std::is_same_v<decltype(p.axis), WoundDcAxisParameters> &&
                !std::is_same_v<P, SeriesDcParameters>)
    return "i_f_a";
  return {};
}

/// A preset of a controller, a trajectory and their parameters.
template <class ControllerType, class Move, const auto& kP, const auto& kPath, const RunTiming& kTiming>
constexpr Preset dc_preset(std::string_view name, std::string_view source, std::string_view expectation,
                           std::string_view bench, std::string_view machine_kind, Quantity quantity) {
  return {.name = name,
          .source = source,
          .expectation = expectation,
          .bench = bench,
          .needs = {.machine_kind = machine_kind,
                    .counts_per_revolution = kP.axis.shaft.counts_per_revolution,
                    .pole_pairs = 0.0,
                    .voltage_limit_v = kP.axis.voltage_limit_v,
                    .quantity = quantity,
                    .signal = signal_of(kP)},
          .gains = [] { return gains_of(kP, kPath, kTiming); },
          .make = [](std::span<const Gain> overrides) -> Run {
            auto [p, path, timing] = with_gains(std::tuple{kP, kPath, kTiming}, overrides);
            timing.sample_rate_hz = p.axis.sample_rate_hz;
            auto move = std::make_shared<Move>(path);
            refuse_beyond_limits(p, *move, p.axis.period_s());
            return {std::make_unique<ControllerType>(p), std::move(move), timing};
          }};
}

}  // namespace drivebench::control
