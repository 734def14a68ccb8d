#pragma once

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// R_S, L_S, K_m, J, f, f_c of a PM synchronous motor with a round rotor by least squares on
///   R i_d + L (i_d' - n_p w i_q)             = u_d
///   R i_q + L (i_q' + n_p w i_d) + K_m w     = u_q
///   J w' + f w + f_c sgn w - K_m i_q         = 0
/// One stage solves all three. Two stages solve the third one after the others, as J w' + ... = K_m i_q, so
/// that the error of the voltages does not enter its indices. Source: the book, (9.104); tags PMID-01,
/// PMID-02.
Result identify_pm_motor(const MeasuredData& data, const Settings& settings);

/// R_S, L_d, L_q, K_m, J, f, f_c of one with a salient rotor, and L_g = (L_d - L_q)/2, by the same on
///   R i_d + L_d i_d' - n_p w L_q i_q                                      = u_d
///   R i_q + L_q i_q' + n_p w L_d i_d + K_m w                              = u_q
///   J w' + f w + f_c sgn w - K_m i_q - n_p (L_d - L_q) i_d i_q            = 0
/// The torque is linear in the parameters too, so one stage solves all. L_g has the mean index of both.
/// Source: the book, problem 9.11 with its torque corrected; tag ST-06.
Result identify_salient_pm_motor(const MeasuredData& data, const Settings& settings);

}  // namespace drivebench::identification
