#pragma once

#include <string>
#include <vector>

#include "protocols/can/codec.hpp"
#include "protocols/can/formats/text.hpp"

namespace drivebench::can {

inline Profile profile_of(bool fd) {
  Profile profile;
  profile.fd = fd;
  return profile;
}

inline Profile with_ids(IdSet set, Profile profile) {
  profile.choose_ids(set, profile.extended);
  return profile;
}

/// Every set of default identifiers, with 11 and with 29 bits.
inline std::vector<Profile> every_id_set(bool fd) {
  std::vector<Profile> profiles;
  for (const IdSet set : {IdSet::kFree, IdSet::kCanopen}) {
    for (const bool extended : {false, true}) {
      profiles.push_back(profile_of(fd));
      profiles.back().choose_ids(set, extended);
    }
  }
  return profiles;
}

/// The same on a bus that has wide axes as well.
inline Profile with_wide_axes(Profile profile) {
  profile.wide = true;
  return profile;
}

inline std::string data_of(const Frame& frame) {
  std::string text;
  append_data(text, frame);
  return text;
}

/// A sample in which every signal has a value of its own.
inline Sample a_sample() {
  Sample sample;
  sample.tick = 0x1'2345'6789;
  sample.command_tick = 0x1'2345'6788;
  sample.command_age_ticks = 1;
  sample.missed_commands = 0x1'0002;
  sample.refused_commands = 0x2'0003;
  sample.late_ticks = 0x104;
  sample.state = 2;
  sample.faults = 0x8000'0010;
  sample.encoder_count = -2;
  sample.encoder_levels = 0x23;
  sample.edge_age_s = 1e-3;
  sample.edge_period_s = 2e-3;
  sample.index_count = -256;
  sample.index_tick = -1;
  sample.i_a_a = 1.0;
  sample.i_b_a = -2.0;
  sample.speed_rad_s = -100.0;
  sample.bus_voltage_v = 48.0;
  sample.i_c_a = 1.5;
  sample.i_f_a = -0.5;
  sample.u_a_v = 10.0;
  sample.u_b_v = -20.0;
  sample.u_c_v = 5.0;
  sample.u_f_v = 24.0;
  sample.u_n_v = -1.0;
  sample.hall_lines = 5;
  sample.tachometer_v = 2.0;
  sample.resolver_sin_v = 0.5;
  sample.resolver_cos_v = -0.25;
  sample.temperature_k = 300.0;
  sample.meter_u_rms_v = 230.0;
  sample.meter_i_rms_a = 2.5;
  sample.meter_p_w = 500.0;
  sample.meter_q_var = -125.0;
  sample.meter_pf = 0.75;
  sample.injected = 0x0800'0001;
  return sample;
}

inline Frame sent(Message message, bool fd) {
  return encode_sample(*find_message(message, fd), profile_of(fd), 5, a_sample());
}

inline FrameProblem problem_of(const Profile& profile, const Frame& frame) {
  return match(profile, frame).problem;
}

inline bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

}  // namespace drivebench::can
