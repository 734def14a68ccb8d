#pragma once

#include "clients/identification/data/settings.hpp"
#include "clients/identification/motors/induction/induction_search.hpp"

namespace drivebench::identification {

/// The parameters of an induction motor that its terminals show, and M and R_R for equal leakages.
struct InductionParameters {
  double stator_resistance_ohm;  ///< R_S = (K_6 - K_4)/K_14
  double rotor_time_constant_s;  ///< T_R = K_8
  double stator_inductance_h;    ///< L_S = (1 + K_4 K_8^2)/(K_14 K_8)
  double leakage_factor;         ///< sigma = 1/(1 + K_4 K_8^2)
  double mutual_inductance_h;    ///< M = L_S sqrt(1 - sigma) with equal leakages, L_R = L_S
  double rotor_resistance_ohm;   ///< R_R = L_S/T_R with these
};

/// Source: the book, (8.101).
InductionParameters induction_parameters(double k4, double k6, double k8, double k14) noexcept;

/// sqrt(limit E^2 g' H^-1 g) for R_S, T_R, L_S, sigma, M, R_R: the change that makes E^2 1.25 E^2*, from the
/// quadratic approximation of E^2 at the minimum. Source: the book, (8.116); tag IMID-03.
std::vector<double> induction_indices(const InductionMinimum& minimum);

/// R_S, T_R, L_S, sigma by the constrained least squares of (8.97)-(8.100), found globally
/// (search_induction), M, L_R, R_R for equal leakages, then J and f or tau_L from
///   w' = K_16 (phi_x i_y - phi_y i_x) - K_17 {w or 1},   K_16 = n_p/J, K_17 = f/J or tau_L/J,
/// with the flux phi = (M/L_R) psi worked out from the measured signals (8.123); both sides pass the filter
/// of the shaft. Tags IMID-01..04.
Result identify_induction_motor(const MeasuredData& data, const Settings& settings);

}  // namespace drivebench::identification
