#pragma once

#include <optional>
#include <vector>

/// Converters of parameters: from what books and data sheets print to what bench files take.
namespace drivebench::command {

/// The equivalent circuits of an induction machine: windings (stator, rotor, mutual) or a T circuit
/// (magnetising, leakages; a missing leakage is 0, which makes it a Γ circuit).
struct ConvertCircuitOptions {
  bool json = false;
  double stator_ohm = 0.0;
  double rotor_ohm = 0.0;
  std::optional<double> stator{};
  std::optional<double> rotor{};
  std::optional<double> mutual{};
  std::optional<double> magnetizing{};
  std::optional<double> stator_leakage{};
  std::optional<double> rotor_leakage{};
  std::optional<double> hz{};  ///< the inductances are reactances at this frequency [ohm]
  bool delta = false;          ///< the numbers are those of the phases of a delta
};
int run_convert_circuit(const ConvertCircuitOptions& options);

/// Winding factors, of a regular winding in slots or of loops at given angles.
struct ConvertWindingOptions {
  bool json = false;
  int slots = 0;
  int poles = 2;
  int phases = 3;
  std::optional<int> pitch_slots{};  ///< nothing: a whole pole
  std::vector<double> angles_deg{};  ///< electrical; instead of slots
};
int run_convert_winding(const ConvertWindingOptions& options);

/// A set of phase quantities in all frames.
struct ConvertFrameOptions {
  bool json = false;
  std::vector<double> abc{};
  std::vector<double> alpha_beta{};
  std::vector<double> dq{};
  double angle_deg = 0.0;  ///< electrical, of the d axis
  bool amplitude = false;  ///< alpha_beta and dq are amplitude-invariant, not power-invariant
};
int run_convert_frame(const ConvertFrameOptions& options);

}  // namespace drivebench::command
