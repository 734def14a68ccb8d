#pragma once

#include <array>
#include <string>
#include <vector>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// One instant of an induction motor in the rotor's frame (x, y at n_p theta), two-phase.
struct InductionInstant {
  double i_x, i_y;              ///< [A]
  double slope_x, slope_y;      ///< i' [A/s]
  double bend_x, bend_y;        ///< i'' [A/s^2]
  double u_x, u_y;              ///< [V]
  double u_slope_x, u_slope_y;  ///< u' [V/s]
  double speed;                 ///< w [rad/s]
  double acceleration;          ///< w' [rad/s^2]
};

inline constexpr std::size_t kInductionParameters = 15;

/// K_j as they depend on K_4, K_6, K_8, K_14: factor x K_8^power. Source: the book, (8.100).
enum class InductionFactor { kOne, kK4, kK6, kK14 };
struct InductionMonomial {
  InductionFactor factor;
  int power;
};
inline constexpr std::array<InductionMonomial, kInductionParameters> kInductionMonomials = {{
    {InductionFactor::kK6, 1},    // gamma
    {InductionFactor::kK4, 2},    // beta M
    {InductionFactor::kK14, 1},   // 1/(sigma L_S)
    {InductionFactor::kK4, 0},    // beta M/T_R^2
    {InductionFactor::kOne, -1},  // 1/T_R
    {InductionFactor::kK6, 0},    // gamma/T_R
    {InductionFactor::kK4, 1},    // beta M/T_R
    {InductionFactor::kOne, 1},   // T_R
    {InductionFactor::kK6, 2},    // gamma T_R
    {InductionFactor::kK4, 3},    // beta M T_R
    {InductionFactor::kOne, 2},   // T_R^2
    {InductionFactor::kK6, 3},    // gamma T_R^2
    {InductionFactor::kK14, 3},   // T_R^2/(sigma L_S)
    {InductionFactor::kK14, 0},   // 1/(sigma L_S T_R)
    {InductionFactor::kK14, 2},   // T_R/(sigma L_S)
}};

/// The two equations y = W K of an instant. No unknown is in the frame, so all its signals are measured.
/// Source: the book, (8.97)-(8.99), all columns checked against the model; tag IMID-01.
struct InductionEquations {
  std::array<double, kInductionParameters> x_row;
  std::array<double, kInductionParameters> y_row;
  double x;
  double y;
};
InductionEquations induction_equations(const InductionInstant& s, double pole_pairs) noexcept;

/// Every sample of the data as such an instant, filtered as the experiment says.
std::vector<InductionInstant> induction_instants(const MeasuredData& data, const Settings& settings);

/// Names K1 .. K15.
std::vector<std::string> induction_parameter_names();

}  // namespace drivebench::identification
