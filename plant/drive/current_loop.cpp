#include "plant/drive/current_loop.hpp"

#include <algorithm>

#include "plant/drive/phases.hpp"

namespace drivebench {

PhaseValues limited_currents(const CurrentLoopParameters& p, const PhaseValues& command_a,
                             Connection connection) noexcept {
  const auto limited = [&p](double x) { return std::clamp(x, -p.limit_a, p.limit_a); };
  PhaseValues result = by_terminal(limited, command_a);
  if (connection == Connection::kStar) {
    const ThreePhase star = without_neutral(phases_of(result));
    result = {.a = star.a, .b = star.b, .c = star.c, .field = result.field};
  }
  return result;
}

}  // namespace drivebench
