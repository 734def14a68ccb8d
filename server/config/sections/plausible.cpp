#include "server/config/sections/plausible.hpp"

#include <string>
#include <variant>

#include "plant/parameters/parameters.hpp"
#include "protocols/text.hpp"

namespace drivebench {
namespace {

// Below this the leakage is a small difference of large numbers, and the current transients are faster than
// those of real machines: most likely a digit is wrong.
constexpr double kLeastLeakageFactor = 0.005;

}  // namespace

std::vector<Problem> oddities(const AxisParameters& p) {
  std::vector<Problem> found;
  for (const Parameter& row : axis_parameters(p)) {
    const double value = row.get(p);
    if (value >= row.usual.low && value <= row.usual.high) continue;
    const bool of_machine = row.name.starts_with("machine.");
    const std::string unit = row.unit == "1" ? std::string() : " " + std::string(row.unit);
    found.push_back(
        {std::string(row.name),
         "is " + shortest(value) + unit + ", which is odd: " +
             (of_machine ? "a machine of kind \"" + std::string(machine_kind(p)) + "\"" : "an axis") +
             " has " + shortest(row.usual.low) + " to " + shortest(row.usual.high) + unit +
             "; --allow-odd takes it all the same"});
  }
  std::visit(
      [&](const auto& machine) {
        if constexpr (requires { leakage_factor(machine); }) {
          const double sigma = leakage_factor(machine);
          if (sigma >= kLeastLeakageFactor) return;
          found.push_back({"machine.mutual_inductance_h",
                           "makes the leakage factor sigma = " + shortest(sigma) +
                               ", which is odd: a machine has " + shortest(kLeastLeakageFactor) +
                               " or more; --allow-odd takes it all the same"});
        }
      },
      p.machine);
  return found;
}

}  // namespace drivebench
