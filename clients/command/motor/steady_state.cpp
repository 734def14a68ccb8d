#include "clients/command/motor/steady_state.hpp"

#include <fmt/format.h>

#include <optional>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/motor/motor_file.hpp"
#include "clients/command/motor/motor_json.hpp"
#include "clients/command/motor/steady_state_plot.hpp"
#include "protocols/document.hpp"
#include "protocols/number_text.hpp"

namespace drivebench::command {
namespace {

using Mode = InductionCircuit::Mode;

InductionMotorFile read_motor(const std::string& choice) {
  try {
    return read_induction_motor(choice);
  } catch (const ConfigError& error) {
    throw UsageError(error.what());
  }
}

void write_plot(const std::string& file, const std::string& text) {
  Output out(file);
  out.write(text);
  out.flush();
}

void print_table(const InductionMotorFile& file, const InductionCircuit& circuit,
                 const std::vector<NamedPoint>& points) {
  fmt::print("{}: {} phases, {:g} V rms each, {:g} Hz; synchronous {} rad/s, sigma {}\n", file.name,
             circuit.phases(), circuit.voltage_v, circuit.frequency_hz,
             number_text(circuit.synchronous_rad_s()), number_text(circuit.motor.leakage()));
  if (circuit.line_resistance_ohm > 0.0 || circuit.line_inductance_h > 0.0) {
    fmt::print(
        "behind {:g} ohm and {:g} H in each phase: the power and cos phi of the line are before these\n",
        circuit.line_resistance_ohm, circuit.line_inductance_h);
  }
  std::string heading(26, ' ');
  for (const char* name :
       {"slip", "rad/s", "A rms", "V rms", "cos phi", "N*m", "line W", "R_S W", "R_R W", "shaft W", "eta"})
    heading += fmt::format("{:>11}", name);
  fmt::print("{}\n", heading);
  for (const auto& [name, p] : points) {
    std::string line = fmt::format("{:<26}", name);
    for (const double value :
         {p.slip, p.speed_rad_s, std::abs(p.stator_a), std::abs(p.terminal_v), p.power_factor(), p.torque_nm,
          p.active_w, p.stator_loss_w, p.rotor_loss_w, p.mechanical_w, p.efficiency()})
      line += fmt::format(" {:>10}", number_text(value));
    fmt::print("{}\n", line);
  }
  const InductionCircuit::Circle circle = circuit.circle();
  fmt::print("circle of the current: centre {:.5g} A active, {:.5g} A reactive, radius {:.5g} A\n",
             circle.centre_a.real(), -circle.centre_a.imag(), circle.radius_a);
  if (!file.left_out.empty())
    fmt::print("of [mechanics] only the viscous friction counts; left out: {}\n",
               fmt::join(file.left_out, ", "));
}

}  // namespace

std::vector<NamedPoint> named_points(const InductionCircuit& circuit, double load_nm) {
  std::vector<NamedPoint> points = {{"synchronous", circuit.at(0.0)}};
  if (const auto slip = circuit.slip_under(load_nm); slip && load_nm != 0.0)
    points.push_back({"load", circuit.at(*slip)});
  points.push_back({"rated (sqrt(sigma) S_p)", circuit.at(circuit.rated_slip())});
  points.push_back({"largest power", circuit.at(circuit.largest_power_slip(Mode::kMotor))});
  points.push_back({"pull-out", circuit.at(circuit.pull_out_slip(Mode::kMotor))});
  points.push_back({"locked", circuit.at(1.0)});
  points.push_back({"generator pull-out", circuit.at(circuit.pull_out_slip(Mode::kGenerator))});
  points.push_back({"generator largest power", circuit.at(circuit.largest_power_slip(Mode::kGenerator))});
  return points;
}

int run_steady_state(const SteadyStateOptions& options) {
  check_suffix(options.plot_file, {".svg"});
  check_suffix(options.circle_file, {".svg"});
  const InductionMotorFile file = read_motor(options.motor);
  const InductionCircuit circuit{.motor = file.motor,
                                 .star = file.star,
                                 .voltage_v = options.voltage_v,
                                 .frequency_hz = options.frequency_hz,
                                 .line_resistance_ohm = options.line_resistance_ohm,
                                 .line_inductance_h = options.line_inductance_h};
  if (!circuit.slip_under(options.load_nm)) {
    const double most_nm = circuit.at(circuit.pull_out_slip(Mode::kMotor)).torque_nm;
    throw UsageError(fmt::format(
        "--load {:g} N*m stalls the motor: with {:g} V and {:g} Hz its pull-out torque is {:.4g} N*m",
        options.load_nm, options.voltage_v, options.frequency_hz, most_nm));
  }
  const std::vector<NamedPoint> points = named_points(circuit, options.load_nm);
  if (options.json) {
    fmt::print("{}\n", steady_state_json(file, circuit, points));
  } else {
    print_table(file, circuit, points);
  }
  const std::string title =
      fmt::format("{}: {:g} V, {:g} Hz", file.name, options.voltage_v, options.frequency_hz);
  if (!options.plot_file.empty()) write_plot(options.plot_file, steady_state_plot(circuit, title));
  if (!options.circle_file.empty()) write_plot(options.circle_file, circle_diagram(circuit, points, title));
  return kExitOk;
}

}  // namespace drivebench::command
