#pragma once

#include <cstddef>
#include <cstdint>

namespace drivebench {

/// Everything that an axis says at one tick, as it is published, recorded and sent. The catalogue
/// (catalogue.hpp) names each member with unit and meaning; message Sample of bench.proto is the same list.
/// 8-byte members only, so that a sample is a block of words for hashing and comparing.
struct Sample {
  std::uint64_t tick = 0;
  std::int64_t command_tick = -1;
  std::uint64_t command_age_ticks = 0;
  std::uint64_t missed_commands = 0;
  std::uint64_t refused_commands = 0;
  std::uint64_t late_ticks = 0;
  std::uint64_t state = 0;
  std::uint64_t faults = 0;
  std::uint64_t owner = 0;
  std::int64_t encoder_count = 0;
  std::uint64_t encoder_levels = 0;
  double edge_age_s = 0.0;
  double edge_period_s = 0.0;
  std::int64_t index_count = 0;
  std::int64_t index_tick = -1;
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double u_a_v = 0.0;
  double u_b_v = 0.0;
  double angle_rad = 0.0;
  double speed_rad_s = 0.0;
  double torque_nm = 0.0;
  double load_nm = 0.0;
  double true_i_a_a = 0.0;
  double true_i_b_a = 0.0;
  double psi_a_wb = 0.0;
  double psi_b_wb = 0.0;
  double bus_voltage_v = 0.0;
  double i_c_a = 0.0;
  double i_f_a = 0.0;
  double u_c_v = 0.0;
  double u_f_v = 0.0;
  double u_n_v = 0.0;
  std::uint64_t hall_lines = 0;
  double tachometer_v = 0.0;
  double resolver_sin_v = 0.0;
  double resolver_cos_v = 0.0;
  double temperature_k = 0.0;
  double meter_u_rms_v = 0.0;
  double meter_i_rms_a = 0.0;
  double meter_p_w = 0.0;
  double meter_q_var = 0.0;
  double meter_pf = 0.0;
  double true_i_c_a = 0.0;
  double true_i_f_a = 0.0;
  double load_angle_rad = 0.0;
  double load_speed_rad_s = 0.0;
  double load_position_m = 0.0;
  std::uint64_t injected = 0;
};

inline constexpr std::size_t kSampleWords = sizeof(Sample) / 8;

}  // namespace drivebench
