#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "clients/identification/data/settings.hpp"
#include "clients/identification/motors/induction/induction_regressor.hpp"

namespace drivebench::identification {

/// The known parameters of the motor for tracking: inductances do not drift with temperature.
struct KnownInductances {
  double stator_inductance_h = 0.0;  ///< L_S
  double leakage_factor = 0.0;       ///< sigma; beta M = (1 - sigma)/sigma
};

/// White noise of the measured currents behind their filter, per sample, equal in both axes of any frame.
struct CurrentNoise {
  double current_a2 = 0.0;          ///< E n^2
  double slope_a2_s2 = 0.0;         ///< E n'^2
  double current_bend_a2_s2 = 0.0;  ///< E n n'', negative
};

/// The noise of currents with this rms behind this filter.
CurrentNoise filtered_noise(double rms_a, const LowPass& filter, double period_s);

/// Resistances of a running induction motor.
struct ResistanceEstimate {
  double stator_resistance_ohm = 0.0;
  double rotor_time_constant_s = 0.0;
  double stator_interval_ohm = 0.0;  ///< half of the 95 % interval; infinite: nothing fits
  double rotor_interval_s = 0.0;
  double stator_index_ohm = 0.0;  ///< until E^2 is 1.25 times as large
  double rotor_index_s = 0.0;
  double error_index = 0.0;
  int degree = 0;  ///< of the resultant, 5
  Excitation excitation{};
};

/// R_S and T_R at constant speed from
///   i_x'' - n_p w i_y' - u_x'/(sigma L_S) = K_1 (-i_x'/(sigma L_S))
///     + K_2 ((beta M + 1)(-i_x' + n_p w i_y) + u_x/(sigma L_S)) + K_1 K_2 (-i_x/(sigma L_S))
/// and the like for y, K_1 = R_S, K_2 = 1/T_R. In sinusoidal steady state the three columns depend on each
/// other, so the constraint is needed: dE^2/dK_1 = 0 is linear in K_1, and the resultant of both conditions
/// is a polynomial of degree 5 in K_2 whose positive roots are found with proof. A second exact solution has
/// 1/T_R < 0; of those with both positive the one with the smallest error is taken. Without slip no current
/// flows in the rotor and T_R cannot be seen. Source: slides of chapter 8; tag IMID-07.
///
/// Noise of the currents stands in the columns too and pulls both down; what it adds to the sums is taken out
/// of them (two Newton steps from the root). The intervals come from the scatter of the equations' scores
/// over ten parts of the data, and a parameter is stated if its interval is below a tenth of it. Nothing is
/// stated if the speed moves by more than half a percent over the data.
ResistanceEstimate identify_resistances(std::span<const InductionInstant> instants, double pole_pairs,
                                        const KnownInductances& known, const CurrentNoise& noise = {});

/// The processing for tracking: all filters at one corner, and edges as long as their memory.
Processing tracking_processing(double cutoff_hz, double period_s, double voltage_shift);

/// Follows the resistances while the motor runs, from a sliding window.
class ResistanceTracker {
 public:
  struct Options {
    Settings settings{};  ///< processing.from_s and to_s are of no effect
    KnownInductances known{};
    double period_s = 0.0;
    std::size_t window = 800;  ///< samples that an estimate goes by
    std::size_t stride = 100;  ///< samples between two estimates
  };
  /// Throws IdentificationError for options that make no sense.
  explicit ResistanceTracker(const Options& options);

  /// One sample: phase currents and voltages (the third ones of three-phase machines only) and the shaft,
  /// counts or radians as the experiment says.
  struct Reading {
    double i_a, i_b, i_c;
    double u_a, u_b, u_c;
    double shaft;
  };
  /// An estimate every `stride` samples once the window is full.
  std::optional<ResistanceEstimate> push(const Reading& reading);
  /// Begins the window anew: samples are missing.
  void restart() noexcept;

 private:
  std::size_t phases() const noexcept;
  ResistanceEstimate estimate_of(const MeasuredData& data) const;

  Options options_;
  std::size_t kept_;  ///< samples in memory: the window and the edges of the filters
  std::size_t since_ = 0;
  CurrentNoise unit_noise_;  ///< of 1 A rms
  MeasuredData data_;
};

}  // namespace drivebench::identification
