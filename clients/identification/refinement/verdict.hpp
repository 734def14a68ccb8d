#pragma once

#include <string>
#include <vector>

#include "clients/identification/data/result.hpp"
#include "clients/identification/data/settings.hpp"
#include "clients/identification/refinement/bend.hpp"
#include "clients/identification/refinement/suspects.hpp"

namespace drivebench::identification {

/// Why the noises do not explain the record; empty if they do. A current may scatter by three times its white
/// part, which a model has no share in, and by a hundredth of the largest current; the terminals may need 3 %
/// of the measured voltages beside them, which is what interpolation between samples and a coarse converter
/// cost; currents and angle may stray 1.5 times as far as the
/// noises and the steps of the encoder make them.
std::string unexplained(const Explanation& found, double largest_current_a);

/// The verdict on a motor with these parameters unseen: the experiment that would show them.
Excitation verdict_on(MotorKind kind, std::vector<std::string> unseen);

/// The verdict on equations that give no motor to begin with: no parameter is stated.
Excitation verdict_without_start(MotorKind kind, const Result& result);

/// The verdict on a motor that does not explain its record: no parameter is stated.
Excitation verdict_against(const Result& result, const std::string& reason);

/// The verdict on a motor whose record has an error of the sensors that the fit does not look for: no
/// parameter is stated.
Excitation verdict_on_suspicion(const Result& result, const Suspicion& suspicion);

/// The verdict on an induction motor whose iron bends and whose record leaves the curve open: no parameter is
/// stated. `saturated` is the fit with its magnetising curve.
Excitation verdict_on_open_curve(const Result& saturated);

/// The verdict on an induction motor whose iron bends at the flux of the record: no parameter is stated.
Excitation verdict_on_saturation(const Result& result, const BendTest& bend);

}  // namespace drivebench::identification
