#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/identification/math/least_squares.hpp"

namespace drivebench::identification {

/// The estimate of a parameter.
struct Estimate {
  std::string name;  ///< the book's: R_S, T_R, L_S, sigma, ...
  std::string unit;
  double value = 0.0;  ///< refined, or that of the equations where there is no refinement
  double index =
      0.0;  ///< parametric error index of the equations: E^2 grows by Result::index_factor within it
  std::optional<double> truth;           ///< if it is known
  std::optional<double> interval{};      ///< half of the 95 % interval about the value
  std::optional<double> by_equations{};  ///< the book's least squares, where the value is refined
};

/// The noises that explain the record, of which the intervals come, and what they are measured against.
struct Explanation {
  double voltage_noise_v = 0.0;  ///< rms, white, that the terminals need beside the measured voltages
  double voltage_rms_v = 0.0;    ///< of the measured voltages
  double current_noise_a = 0.0;  ///< rms, white
  double current_error = 0.0;    ///< rms of the currents' innovations over what both noises make them
  double current_white_a = 0.0;  ///< what the measured currents show without a model
  double angle_error = 0.0;      ///< rms of the angle's innovations over what the encoder's counts make them
  double unlikelihood = 0.0;     ///< minus twice the logarithm of the likelihood, less a constant
  bool holds = false;            ///< these noises are ones that a record may have
};

/// A fact about the wiring of a record: found in the data (find_wiring.hpp), or set.
struct WiringFact {
  std::string name;  ///< pole_pairs, direction (1: with the phases, -1: against them), voltage_shift, zero
  std::string unit;
  std::optional<double> found{};  ///< nothing: the data do not tell
  double interval = 0.0;          ///< half of the 95 % interval of what was found; 0: a whole number
  double used = 0.0;              ///< what the identification works with
  bool given = false;             ///< set by the user or known of the bench: used, whatever was found
  bool contradicts = false;       ///< the data say something else than what is given
  std::string remark{};           ///< why the data do not tell, or what they leave open
};

/// The result of an identification.
struct Result {
  std::string kind;    ///< kind of machine in motor files: induction, pm_synchronous, pm_dc, bldc
  std::string method;  ///< one line for display
  std::vector<Estimate> parameters{};
  double index_factor = 2.0;  ///< 2 or 1.25
  double error_index = 0.0;   ///< sqrt(E^2/R_y) of the electrical equations, or of all in one stage
  std::optional<double> mechanical_error_index{};
  double condition =
      0.0;  ///< of the regressor with columns of unit length, or of the Hessian scaled to a unit diagonal
  double normal_condition = 0.0;  ///< DC motor: of R_W as in the book, unscaled
  std::size_t samples = 0;
  Excitation excitation{};
  std::optional<Explanation> explanation{};  ///< of the refinement
  std::vector<Estimate> sensors{};           ///< errors that were looked for: "i_a_a offset", "u_b_v gain";
                                             ///< without an interval: the data do not tell
  std::vector<WiringFact> wiring{};          ///< empty: not looked for
  std::vector<double> curve_wb{};  ///< fluxes of the points of the magnetising curve, rising: curve_name()
  std::vector<std::string> notes{};

  /// The estimate of this name, or null.
  const Estimate* find(std::string_view name) const noexcept;
  Estimate* find(std::string_view name) noexcept;
  /// Its value; throws IdentificationError if there is none.
  double at(std::string_view name) const;
  /// Whether the data do not determine this parameter.
  bool is_unseen(std::string_view name) const noexcept;
  /// Puts the truth beside the estimates of these names.
  void compare(const std::map<std::string, double, std::less<>>& truth);
};

/// The name of the magnetising current at this flux, a parameter of a motor whose iron saturates.
std::string curve_name(double flux_wb);

/// Whether this is an induction motor with a magnetising curve.
bool is_saturated(const Result& result) noexcept;

/// Whether this is a PM synchronous motor with L_d and L_q in place of L_S.
bool is_salient(const Result& result) noexcept;

/// Whether the truth lies within the interval of the estimate, or within its index where it has none. Nothing
/// if the truth is unknown or the parameter is unseen.
std::optional<bool> is_inside(const Result& result, const Estimate& estimate) noexcept;

/// The cells of an estimate in a table; "-" for what is unknown, and an unseen parameter shows no number.
struct EstimateText {
  std::string value{};
  std::string interval = "-";  ///< half of it, in percent of the value
  std::string truth = "-";
  std::string error = "-";  ///< in percent of the truth
  std::string by_equations = "-";
  std::string index = "-";  ///< in percent of the value by the equations
};
EstimateText text_of(const Result& result, const Estimate& estimate);

/// The error of a sensor as text: "i_a_a offset 0.2 A +- 0.01 A", or that the data do not tell it.
std::string sensor_text(const Estimate& error);

/// A fact as text: "pole pairs 6, found, as set".
std::string wiring_text(const WiringFact& fact);

/// The noises as a line.
std::string explanation_text(const Explanation& explanation);

/// A table of the estimates with interval, truth, error, and the values of the equations with their index;
/// verdict, explanation and notes below it.
std::string to_markdown(const Result& result);

/// {kind, method, identifiable, unseen, verdict, parameters: {R_S: {estimate, unit, interval, by_equations,
/// index, truth, inside}}, wiring: {pole_pairs: {found, unit, interval, used, given, contradicts, remark}},
/// sensors: {"i_a_a offset": {estimate, unit, interval}}, magnetising_curve: [{flux_wb, current_a,
/// interval_a}], explanation, ...}; a number that is not finite and the estimate of an unseen parameter are
/// null.
std::string to_json(const Result& result);

/// The contents of a motor file beside the estimates.
struct MotorFile {
  std::string name{};
  std::string source{};
  int pole_pairs = 1;
  bool star = true;
};

/// A file for configs/motors. An induction motor gets equal leakages, L_R = L_S, because its terminals do not
/// show the split; one with a magnetising curve the likeliest split, and the curve up to the largest flux of
/// the record. Throws IdentificationError if a parameter is unseen or an estimate is impossible for a motor.
std::string to_motor_toml(const Result& result, const MotorFile& file);

}  // namespace drivebench::identification
