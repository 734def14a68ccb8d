#include "plant/amplifier.hpp"

#include <algorithm>

namespace drivebench {

AmplifierOutput amplifier_output(const AmplifierParameters& p, const PhaseCommand& command) noexcept {
  if (command.gates != Gates::kVoltage) return {.voltage_v = {0.0, 0.0}, .saturated = false};
  const TwoPhase wanted_v{p.gain * command.voltage_v.a + p.offset_a_v,
                          p.gain * command.voltage_v.b + p.offset_b_v};
  const TwoPhase voltage_v{std::clamp(wanted_v.a, -p.voltage_limit_v, p.voltage_limit_v),
                           std::clamp(wanted_v.b, -p.voltage_limit_v, p.voltage_limit_v)};
  return {.voltage_v = voltage_v, .saturated = voltage_v.a != wanted_v.a || voltage_v.b != wanted_v.b};
}

}  // namespace drivebench
