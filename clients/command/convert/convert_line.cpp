#include "clients/command/convert/convert_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/convert/convert.hpp"

namespace drivebench::command {
namespace {

constexpr double kLeast = 1e-12;

void add_circuit(CommandLine& line, CLI::App& convert) {
  const auto [sub, o] = line.add<ConvertCircuitOptions>(
      convert, "circuit", "print the equivalent circuits of an induction machine", run_convert_circuit);
  const auto add = [&sub = sub](const char* name, auto& value, const char* unit, const char* text) {
    return sub.add_option(name, value, text)->type_name(unit)->check(finite_between(kLeast, kMost));
  };
  const auto add_leakage = [&sub = sub](const char* name, auto& value, const char* text) {
    sub.add_option(name, value, text)->type_name("H")->check(finite_between(0.0, kMost));
  };
  begin_group(sub, "Resistances");
  add("--stator-ohm", o.stator_ohm, "OHM", "resistance of a stator phase")->required();
  add("--rotor-ohm", o.rotor_ohm, "OHM", "resistance of a rotor phase, of the same turns as the inductances")
      ->required();
  begin_group(sub, "Inductances of the windings");
  add("--stator", o.stator, "H", "inductance L_S of the stator");
  add("--rotor", o.rotor, "H", "inductance L_R of the rotor");
  add("--mutual", o.mutual, "H", "mutual inductance M");
  begin_group(sub, "Inductances of a T circuit, instead of those of the windings");
  add("--magnetizing", o.magnetizing, "H", "magnetising inductance");
  add_leakage("--stator-leakage", o.stator_leakage, "leakage inductance of the stator; 0 in a gamma circuit");
  add_leakage("--rotor-leakage", o.rotor_leakage,
              "leakage inductance of the rotor; 0 in an inverse gamma circuit");
  begin_group(sub, "What the numbers mean");
  add("--hz", o.hz, "HZ", "the inductances are reactances [ohm] at this frequency");
  sub.add_flag("--delta", o.delta, "the numbers are those of the phases of a delta, not of a star");
  sub.footer(
      "Example:\n  drivebench convert circuit --stator-ohm 1.85 --rotor-ohm 2.1 --magnetizing 84.8 "
      "--stator-leakage 7.16 --rotor-leakage 7.16 --hz 60");
}

void add_winding(CommandLine& line, CLI::App& convert) {
  const auto [sub, o] = line.add<ConvertWindingOptions>(
      convert, "winding", "print winding factors from slots, or from the angles of loops",
      run_convert_winding);
  begin_group(sub, "The winding");
  sub.add_option("--slots", o.slots, "slots of the whole stator")
      ->type_name("NUMBER")
      ->check(whole_between(1, 10'000));
  sub.add_option("--poles", o.poles, "poles of the winding, two for each pole pair")
      ->type_name("NUMBER")
      ->check(whole_between(2, 1'000))
      ->capture_default_str();
  sub.add_option("--phases", o.phases, "phases of the winding")
      ->type_name("NUMBER")
      ->check(whole_between(1, 100))
      ->capture_default_str();
  sub.add_option("--pitch", o.pitch_slots, "slots that a coil spans; default: a whole pole")
      ->type_name("SLOTS")
      ->check(whole_between(1, 10'000));
  sub.add_option("--angles-deg", o.angles_deg,
                 "electrical angles of equal loops, instead of slots; separated by commas")
      ->type_name("DEGREES")
      ->delimiter(',')
      ->check(finite_between(-kMost, kMost));
  sub.footer("Example:\n  drivebench convert winding --slots 24 --poles 2 --pitch 10");
}

void add_frame(CommandLine& line, CLI::App& convert) {
  const auto [sub, o] = line.add<ConvertFrameOptions>(
      convert, "frame", "print phase quantities as abc, alpha-beta and dq, in both scalings",
      run_convert_frame);
  const auto add = [&sub = sub](const char* name, std::vector<double>& values, const char* form, int count,
                                const char* text) {
    sub.add_option(name, values, text)
        ->type_name(form)
        ->delimiter(',')
        ->expected(count)
        ->check(finite_between(-kMost, kMost));
  };
  begin_group(sub, "The quantities, one of these");
  add("--abc", o.abc, "A,B,C", 3, "the three phases");
  add("--alpha-beta", o.alpha_beta, "ALPHA,BETA", 2, "the frame of the stator");
  add("--dq", o.dq, "D,Q", 2, "the frame at --angle-deg");
  begin_group(sub, "What the numbers mean");
  sub.add_option("--angle-deg", o.angle_deg, "electrical angle of the d axis; 0 without it")
      ->type_name("DEGREES")
      ->check(finite_between(-kMost, kMost));
  sub.add_flag("--amplitude-invariant", o.amplitude,
               "alpha, beta, d and q have the amplitude of the phases; without it the power is kept, as on "
               "the bench");
  sub.footer("Example:\n  drivebench convert frame --abc 2,-1,-1 --angle-deg 90");
}

}  // namespace

void add_convert_commands(CommandLine& line) {
  CLI::App& convert =
      *line.app().add_subcommand("convert", "convert parameters and quantities into other forms");
  convert.require_subcommand(1);
  add_circuit(line, convert);
  add_winding(line, convert);
  add_frame(line, convert);
}

}  // namespace drivebench::command
