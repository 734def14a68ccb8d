#include "clients/command/motor/motor_json.hpp"

#include "clients/command/common/basics/json.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {

std::string steady_state_json(const InductionMotorFile& file, const InductionCircuit& circuit,
                              const std::vector<NamedPoint>& points) {
  Json rows = Json::object();
  for (const auto& [name, p] : points) {
    rows[std::string(name)] = {{"slip", p.slip},
                               {"speed_rad_s", p.speed_rad_s},
                               {"current_rms_a", std::abs(p.stator_a)},
                               {"rotor_current_rms_a", std::abs(p.rotor_a)},
                               {"terminal_rms_v", std::abs(p.terminal_v)},
                               {"power_factor", p.power_factor()},
                               {"torque_nm", p.torque_nm},
                               {"active_w", p.active_w},
                               {"reactive_var", p.reactive_var},
                               {"line_loss_w", p.line_loss_w},
                               {"stator_loss_w", p.stator_loss_w},
                               {"rotor_loss_w", p.rotor_loss_w},
                               {"mechanical_w", p.mechanical_w},
                               {"efficiency", p.efficiency()}};
  }
  const InductionCircuit::Circle circle = circuit.circle();
  const Json report = {{"motor", file.name},
                       {"voltage_v", circuit.voltage_v},
                       {"frequency_hz", circuit.frequency_hz},
                       {"line_resistance_ohm", circuit.line_resistance_ohm},
                       {"line_inductance_h", circuit.line_inductance_h},
                       {"phases", circuit.phases()},
                       {"synchronous_rad_s", circuit.synchronous_rad_s()},
                       {"leakage_factor", circuit.motor.leakage()},
                       {"points", std::move(rows)},
                       {"circle",
                        {{"centre_active_a", circle.centre_a.real()},
                         {"centre_reactive_a", -circle.centre_a.imag()},
                         {"radius_a", circle.radius_a}}},
                       {"left_out", file.left_out}};
  return json_text(report, 2);
}

}  // namespace drivebench::command
