#pragma once

#include <string>

namespace drivebench {

/// One thing that is wrong with a set of parameters.
struct Problem {
  std::string field;  ///< path of the value, for example "machine.rotor_resistance_ohm"
  std::string rule;   ///< the value and the rule it breaks, as a sentence for the user
};

}  // namespace drivebench
