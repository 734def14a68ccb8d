#include "clients/command/motor/motor_line.hpp"

#include "clients/command/common/line/command_line.hpp"
#include "clients/command/motor/steady_state.hpp"

namespace drivebench::command {

void add_motor_commands(CommandLine& line) {
  const auto [sub, o] = line.add<SteadyStateOptions>(
      "steady-state", "tell how an induction motor runs on a line, from its equivalent circuit",
      run_steady_state);
  sub.add_option("MOTOR", o.motor, "a motor file, or the name of one of configs/motors, such as im-b")
      ->type_name("MOTOR")
      ->required();
  begin_group(sub, "The line and the load");
  sub.add_option("--voltage", o.voltage_v, "voltage of a phase [V rms]; line to line over sqrt(3)")
      ->type_name("VOLTS")
      ->required()
      ->check(finite_between(1e-6, 1e9));
  sub.add_option("--frequency", o.frequency_hz, "frequency of the line")
      ->type_name("HZ")
      ->required()
      ->check(finite_between(1e-6, 1e6));
  sub.add_option("--load", o.load_nm, "torque on the shaft [N*m]; negative drives it as a generator")
      ->type_name("NM")
      ->check(finite_between(-kMost, kMost))
      ->capture_default_str();
  sub.add_option("--line-ohm", o.line_resistance_ohm,
                 "resistance in series with each phase, of a cable or a transformer")
      ->type_name("OHM")
      ->check(finite_between(0.0, 1e6))
      ->capture_default_str();
  sub.add_option("--line-h", o.line_inductance_h, "inductance in series with each phase")
      ->type_name("H")
      ->check(finite_between(0.0, 1e3))
      ->capture_default_str();
  begin_group(sub, kOutput);
  sub.add_option("--plot", o.plot_file, "write torque, current and power over speed as an SVG picture")
      ->type_name("FILE");
  sub.add_option("--circle", o.circle_file, "write the circle diagram as an SVG picture")->type_name("FILE");
  sub.footer(
      "Example:\n  drivebench steady-state im-b --voltage 120 --frequency 60 --load 2 --plot im-b.svg\n"
      "Exit codes: 0 ok, 2 usage or motor file, also a load that the motor cannot carry.");
}

}  // namespace drivebench::command
