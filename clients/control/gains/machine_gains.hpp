#pragma once

#include <tuple>

#include "clients/control/gains/gains.hpp"
#include "clients/models/bldc_machine.hpp"
#include "clients/models/dc_machine.hpp"
#include "clients/models/induction_machine.hpp"
#include "clients/models/pm_machine.hpp"
#include "clients/models/salient_pm_machine.hpp"
#include "clients/models/wound_dc_machine.hpp"
#include "clients/models/wound_rotor_machine.hpp"

// The gain tables of the machine models: clients/models has no gains.
namespace drivebench::control {

template <>
inline constexpr auto kGainsOf<DcMachineModel> = std::tuple{
    gain("resistance_ohm", &DcMachineModel::resistance_ohm, GainRule::kNotNegative),
    gain("inductance_h", &DcMachineModel::inductance_h, GainRule::kPositive),
    gain("torque_constant_nm_per_a", &DcMachineModel::torque_constant_nm_per_a, GainRule::kPositive),
    gain("inertia_kgm2", &DcMachineModel::inertia_kgm2, GainRule::kPositive),
    gain("friction_nms", &DcMachineModel::friction_nms, GainRule::kNotNegative)};

template <>
inline constexpr auto kGainsOf<PmMachineModel> = std::tuple{
    gain("pole_pairs", &PmMachineModel::pole_pairs, GainRule::kPositive),
    gain("resistance_ohm", &PmMachineModel::resistance_ohm, GainRule::kPositive),
    gain("inductance_h", &PmMachineModel::inductance_h, GainRule::kPositive),
    gain("torque_constant_nm_per_a", &PmMachineModel::torque_constant_nm_per_a, GainRule::kPositive),
    gain("friction_nms", &PmMachineModel::friction_nms, GainRule::kNotNegative),
    gain("inertia_kgm2", &PmMachineModel::inertia_kgm2, GainRule::kPositive)};

template <>
inline constexpr auto kGainsOf<SalientPmModel> = std::tuple{
    gain("pole_pairs", &SalientPmModel::pole_pairs, GainRule::kPositive),
    gain("resistance_ohm", &SalientPmModel::resistance_ohm, GainRule::kPositive),
    gain("inductance_d_h", &SalientPmModel::inductance_d_h, GainRule::kPositive),
    gain("inductance_q_h", &SalientPmModel::inductance_q_h, GainRule::kPositive),
    gain("torque_constant_nm_per_a", &SalientPmModel::torque_constant_nm_per_a, GainRule::kPositive),
    gain("friction_nms", &SalientPmModel::friction_nms, GainRule::kNotNegative),
    gain("inertia_kgm2", &SalientPmModel::inertia_kgm2, GainRule::kPositive)};

template <>
inline constexpr auto kGainsOf<BldcMachineModel> = std::tuple{
    gain("pole_pairs", &BldcMachineModel::pole_pairs, GainRule::kPositive),
    gain("resistance_ohm", &BldcMachineModel::resistance_ohm, GainRule::kNotNegative),
    gain("torque_constant_nm_per_a", &BldcMachineModel::torque_constant_nm_per_a, GainRule::kPositive),
    gain("friction_nms", &BldcMachineModel::friction_nms, GainRule::kNotNegative),
    gain("inertia_kgm2", &BldcMachineModel::inertia_kgm2, GainRule::kPositive)};

template <>
inline constexpr auto kGainsOf<WoundRotorModel> =
    std::tuple{gain("pole_pairs", &WoundRotorModel::pole_pairs, GainRule::kPositive),
               gain("stator_resistance_ohm", &WoundRotorModel::stator_resistance_ohm, GainRule::kPositive),
               gain("stator_inductance_h", &WoundRotorModel::stator_inductance_h, GainRule::kPositive),
               gain("field_resistance_ohm", &WoundRotorModel::field_resistance_ohm, GainRule::kPositive),
               gain("field_inductance_h", &WoundRotorModel::field_inductance_h, GainRule::kPositive),
               gain("mutual_inductance_h", &WoundRotorModel::mutual_inductance_h, GainRule::kPositive),
               gain("friction_nms", &WoundRotorModel::friction_nms, GainRule::kNotNegative),
               gain("inertia_kgm2", &WoundRotorModel::inertia_kgm2, GainRule::kPositive)};

template <>
inline constexpr auto kGainsOf<WoundDcModel> = std::tuple{
    gain("armature_resistance_ohm", &WoundDcModel::armature_resistance_ohm, GainRule::kPositive),
    gain("armature_inductance_h", &WoundDcModel::armature_inductance_h, GainRule::kPositive),
    gain("motor_constant", &WoundDcModel::motor_constant, GainRule::kPositive),
    gain("field_resistance_ohm", &WoundDcModel::field_resistance_ohm, GainRule::kPositive),
    gain("field_flux_scale", &WoundDcModel::field_flux_scale, GainRule::kPositive),
    gain("field_shunt_resistance_ohm", &WoundDcModel::field_shunt_resistance_ohm, GainRule::kNotNegative),
    gain("inertia_kgm2", &WoundDcModel::inertia_kgm2, GainRule::kPositive),
    gain("friction_nms", &WoundDcModel::friction_nms, GainRule::kNotNegative)};

/// The rotor and the shaft of an induction machine, between which the stator stands in a list for users.
inline constexpr std::tuple kRotorGains{
    gain("pole_pairs", &InductionMachineModel::pole_pairs, GainRule::kPositive),
    gain("mutual_inductance_h", &InductionMachineModel::mutual_inductance_h, GainRule::kPositive),
    gain("rotor_resistance_ohm", &InductionMachineModel::rotor_resistance_ohm, GainRule::kPositive),
    gain("rotor_inductance_h", &InductionMachineModel::rotor_inductance_h, GainRule::kPositive)};
inline constexpr std::tuple kShaftGains{
    gain("friction_nms", &InductionMachineModel::friction_nms, GainRule::kNotNegative),
    gain("inertia_kgm2", &InductionMachineModel::inertia_kgm2, GainRule::kPositive)};

template <>
inline constexpr auto kGainsOf<InductionMachineModel> = std::tuple_cat(kRotorGains, kShaftGains);

template <>
inline constexpr auto kGainsOf<InductionMotorModel> = std::tuple{
    gains_in("", &InductionMotorModel::machine, kRotorGains),
    gain("stator_resistance_ohm", &InductionMotorModel::stator_resistance_ohm, GainRule::kPositive),
    gain("stator_inductance_h", &InductionMotorModel::stator_inductance_h, GainRule::kPositive),
    gains_in("", &InductionMotorModel::machine, kShaftGains)};

}  // namespace drivebench::control
