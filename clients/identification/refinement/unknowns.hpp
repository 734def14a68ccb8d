#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "clients/identification/data/result.hpp"
#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// A parameter that the refinement moves. Positive ones move in their logarithm, so that no step leads to a
/// motor that cannot be; friction and load, which may come out as zero, in a scale of their own.
struct Unknown {
  std::string name;
  double scale = 0.0;  ///< of a coordinate of 1; 0: the coordinate is the logarithm
};

/// The standard deviation of the split of an induction motor's leakages before the record says anything: it
/// lies between -1 and 1.
inline constexpr double kSplit = 0.5;

/// The unknowns of a kind of motor. A coordinate of friction or load is what brings the speed from its
/// largest value to rest within the window, `inertia`·`speed`/`duration`.
std::vector<Unknown> unknowns_of(const Settings& settings, const Result& start, double speed_rad_s,
                                 double duration_s);

/// The coordinates of the estimates of a result, and the result with the estimates at these coordinates.
Eigen::VectorXd coordinates_of(const std::vector<Unknown>& unknowns, const Result& result);
void put(const std::vector<Unknown>& unknowns, const Eigen::VectorXd& at, Result& result);

/// Sets all estimates that follow from the unknowns: M, L_R, R_R, K4 to K17 of an induction motor, L_g of a
/// salient PM motor.
void put_dependent(const Settings& settings, Result& result);

}  // namespace drivebench::identification
