#pragma once

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// The book's least squares: parameters, error indices and a verdict on the excitation alone. Columns: i_a_a,
/// i_b_a, i_c_a and u_a_v, u_b_v, u_c_v (the third ones of three-phase machines only; a DC motor has phase
/// a), encoder_count or angle_rad. Throws IdentificationError if the data cannot be used at all; if they can
/// but do not excite the motor, the result says so. A PM synchronous motor is taken as round.
Result identify_by_equations(const MeasuredData& data, const Settings& settings);

/// One call: the book's least squares and their refinement (refinement/refine.hpp) give parameters with 95 %
/// intervals and the verdict. A PM synchronous motor gets L_d, L_q and L_g where the record tells L_g from
/// none by 4 standard deviations, else L_S and a note on how large L_g may be, unless Settings::rotor says
/// which.
Result identify(const MeasuredData& data, const Settings& settings);

}  // namespace drivebench::identification
