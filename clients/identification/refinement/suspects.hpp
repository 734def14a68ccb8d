#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "clients/identification/data/settings.hpp"
#include "clients/identification/refinement/flow.hpp"
#include "clients/identification/refinement/gauss_newton.hpp"
#include "clients/identification/refinement/unknowns.hpp"

namespace drivebench::identification {

/// An error of the sensors that a fit does not look for, although it may be in the record.
struct Suspect {
  std::string what;    ///< with an amount of `{}` in its unit: "an offset of {} A of i_a_a"
  std::string remedy;  ///< what to do about it
  /// Those of the fit, and `size` of this one; in each of its directions: an error that turns with the shaft
  /// has two, its sine and its cosine.
  std::vector<SensorErrors> errors;
  double size;
};

/// Offsets, gains, the encoder's zero as far as the settings do not look for them; delays of currents,
/// voltages and encoder, and an encoder off its centre. `at`: the errors of the fit.
std::vector<Suspect> suspects_of(const Settings& settings, const PredictorRecord& record,
                                 const SensorErrors& at);

inline constexpr double kFalseAlarms = 1e-3;  ///< of the records without an error of a sensor, at most

/// What the score of one of so many suspects must pass, in standard deviations z: noise passes it in at most
/// e^(-z^2/2) of the scores (Chernoff), so that one of all suspects passes in kFalseAlarms at most.
double telling_deviations(std::size_t suspects);

/// What a fit says of a suspect.
struct Suspicion {
  std::string what;         ///< with its amount
  std::string remedy;       ///< of the suspect
  double deviations = 0.0;  ///< how clearly the innovations want it
  double tells = 0.0;       ///< telling_deviations() of all suspects
  std::string moved{};      ///< the unknown that it would move farthest in its intervals
  double shift = 0.0;       ///< by so many of its 95 % intervals
};

/// The suspect that the innovations of a fit want most, by telling_deviations() at least, of those that would
/// move a parameter out of its interval; nothing if there is none. It is the score test of Lagrange
/// multipliers, as test_bend(): what no unknown can take over of the error is compared with the innovations.
/// Where what the error leaves of them scatters more than white ones over parts of the record, that is their
/// variance. `directions` are the derivatives of the innovations by the amount of each suspect in each of its
/// directions, which are asked together: neither of two may tell or move much where both do.
std::optional<Suspicion> strongest_suspicion(const Fit& fit, const std::vector<Unknown>& unknowns,
                                             const std::vector<Suspect>& suspects,
                                             Eigen::MatrixXd directions);

}  // namespace drivebench::identification
