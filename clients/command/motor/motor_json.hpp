#pragma once

#include <string>
#include <vector>

#include "clients/command/motor/motor_file.hpp"
#include "clients/command/motor/steady_state.hpp"

namespace drivebench::command {

std::string steady_state_json(const InductionMotorFile& file, const InductionCircuit& circuit,
                              const std::vector<NamedPoint>& points);

}  // namespace drivebench::command
