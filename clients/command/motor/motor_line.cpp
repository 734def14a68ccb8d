#include "clients/command/motor/motor_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/motor/steady_state.hpp"

namespace drivebench::command {

void add_motor_commands(CommandLine& line) {
  const auto [sub, o] = line.add<SteadyStateOptions>(
      "steady-state", "an induction motor on a line, from its equivalent circuit", run_steady_state);
  sub.add_option("MOTOR", o.motor, "a file of configs/motors or its name, im-b for example")
      ->type_name("MOTOR")
      ->required();
  sub.add_option("--voltage", o.voltage_v, "of a phase [V rms]; line to line over sqrt(3)")
      ->required()
      ->check(finite_between(1e-6, 1e9));
  sub.add_option("--frequency", o.frequency_hz, "of the line [Hz]")
      ->required()
      ->check(finite_between(1e-6, 1e6));
  sub.add_option("--load", o.load_nm, "torque on the shaft [N*m]; negative drives it as a generator")
      ->check(finite_between(-kMost, kMost))
      ->capture_default_str();
  sub.add_option("--line-ohm", o.line_resistance_ohm,
                 "in series with each phase [ohm]: of a cable, a transformer")
      ->check(finite_between(0.0, 1e6))
      ->capture_default_str();
  sub.add_option("--line-h", o.line_inductance_h, "in series with each phase [H]")
      ->check(finite_between(0.0, 1e3))
      ->capture_default_str();
  sub.add_option("--plot", o.plot_file, "write torque, current and power over speed as an SVG picture")
      ->type_name("FILE");
  sub.add_option("--circle", o.circle_file, "write the circle diagram as an SVG picture")->type_name("FILE");
  sub.footer("Exit codes: 0 ok, 2 usage or motor file, also a load that the motor cannot carry.");
}

}  // namespace drivebench::command
