#include "clients/command/convert/convert_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/convert/convert.hpp"

namespace drivebench::command {
namespace {

constexpr double kLeast = 1e-12;

void add_circuit(CommandLine& line, CLI::App& convert) {
  const auto [sub, o] = line.add<ConvertCircuitOptions>(
      convert, "circuit", "the equivalent circuits of an induction machine", run_convert_circuit);
  const CLI::Validator positive = finite_between(kLeast, kMost);
  const CLI::Validator leakage = finite_between(0.0, kMost);
  sub.add_option("--stator-ohm", o.stator_ohm, "resistance of a stator phase")->required()->check(positive);
  sub.add_option("--rotor-ohm", o.rotor_ohm,
                 "resistance of a rotor phase, of the same turns as the inductances")
      ->required()
      ->check(positive);
  sub.add_option("--stator", o.stator, "inductance of the stator [H], L_S")->check(positive);
  sub.add_option("--rotor", o.rotor, "inductance of the rotor [H], L_R")->check(positive);
  sub.add_option("--mutual", o.mutual, "mutual inductance [H], M")->check(positive);
  sub.add_option("--magnetizing", o.magnetizing, "of a T circuit [H], instead of the three")->check(positive);
  sub.add_option("--stator-leakage", o.stator_leakage, "of a T circuit [H]; 0 in a gamma circuit")
      ->check(leakage);
  sub.add_option("--rotor-leakage", o.rotor_leakage, "of a T circuit [H]; 0 in an inverse gamma circuit")
      ->check(leakage);
  sub.add_option("--hz", o.hz, "the inductances are reactances [ohm] at this frequency")->check(positive);
  sub.add_flag("--delta", o.delta, "the numbers are those of the phases of a delta");
}

void add_winding(CommandLine& line, CLI::App& convert) {
  const auto [sub, o] = line.add<ConvertWindingOptions>(
      convert, "winding", "winding factors from slots, or from the angles of loops", run_convert_winding);
  sub.add_option("--slots", o.slots, "of the whole stator")->check(CLI::Range(1, 10'000));
  sub.add_option("--poles", o.poles)->check(CLI::Range(2, 1'000))->capture_default_str();
  sub.add_option("--phases", o.phases)->check(CLI::Range(1, 100))->capture_default_str();
  sub.add_option("--pitch", o.pitch_slots, "slots that a coil spans; default: a whole pole")
      ->check(CLI::Range(1, 10'000));
  sub.add_option("--angles-deg", o.angles_deg, "electrical angles of equal loops, instead of slots")
      ->delimiter(',')
      ->check(finite_between(-kMost, kMost));
}

void add_frame(CommandLine& line, CLI::App& convert) {
  const auto [sub, o] = line.add<ConvertFrameOptions>(
      convert, "frame", "phase quantities as abc, alpha-beta and dq, in both scalings", run_convert_frame);
  const CLI::Validator finite = finite_between(-kMost, kMost);
  sub.add_option("--abc", o.abc, "A,B,C")->delimiter(',')->expected(3)->check(finite);
  sub.add_option("--alpha-beta", o.alpha_beta, "ALPHA,BETA")->delimiter(',')->expected(2)->check(finite);
  sub.add_option("--dq", o.dq, "D,Q")->delimiter(',')->expected(2)->check(finite);
  sub.add_option("--angle-deg", o.angle_deg, "electrical angle of the d axis")->check(finite);
  sub.add_flag("--amplitude-invariant", o.amplitude,
               "alpha, beta, d and q have the amplitude of the phases; without it the power is kept, as on "
               "the bench");
}

}  // namespace

void add_convert_commands(CommandLine& line) {
  CLI::App& convert = *line.app().add_subcommand("convert", "parameters and quantities in other forms");
  convert.require_subcommand(1);
  add_circuit(line, convert);
  add_winding(line, convert);
  add_frame(line, convert);
}

}  // namespace drivebench::command
