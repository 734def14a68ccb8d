#pragma once

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// R_S, L+M, tau_p, J, f of a brushless DC motor in an isolated star by least squares on
///   (L+M) i_k' + R i_k - tau_p w (e_k - e_mean) = u_k - u_mean        k = 1, 2, 3
///   J w' + f w + tau_p (e_1 i_1 + e_2 i_2 + e_3 i_3) = 0
/// A phase links -M of another phase's current, so a star shows L + M; with the sign of the literature it is
/// L - M. e has the sense of the terminal voltage: motoring currents are opposite to it. Products are formed
/// before filtering, because filtering would round the corners of e. Source: the book, chapter 10; tag
/// BL-01.
Result identify_bldc_motor(const MeasuredData& data, const Settings& settings);

}  // namespace drivebench::identification
