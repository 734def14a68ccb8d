#include "plant/drive/amplifier.hpp"

#include <algorithm>

#include "plant/drive/phases.hpp"

namespace drivebench {

PhaseValues amplified(const AmplifierParameters& p, const PhaseValues& command_v) noexcept {
  return {.a = p.gain * command_v.a + p.offset_a_v,
          .b = p.gain * command_v.b + p.offset_b_v,
          .c = p.gain * command_v.c + p.offset_c_v,
          .field = p.gain * command_v.field};
}

LimitedVoltages clipped(const ThreePhase& wanted_v, double limit_v) noexcept {
  const auto limited = [limit_v](double x) { return std::clamp(x, -limit_v, limit_v); };
  const ThreePhase v = by_phase(limited, wanted_v);
  return {.voltage_v = v, .saturated = v.a != wanted_v.a || v.b != wanted_v.b || v.c != wanted_v.c};
}

}  // namespace drivebench
