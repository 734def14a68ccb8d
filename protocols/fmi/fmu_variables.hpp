#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocols/abi/drivebench.h"

/// The variables of a Functional Mock-up Unit (FMI) that holds a bench: the model description lists them, and
/// the unit looks them up.
namespace drivebench::fmi {

enum class Causality { kInput, kParameter, kOutput };

/// The types of FMI 3; in FMI 2 the 64-bit integers are Real, which holds them exactly up to 2^53.
enum class Type { kReal, kInt32, kInt64, kUInt64 };

/// What a variable stands for; `row` counts within it.
enum class Purpose {
  kSetpoint,   ///< of terminal a, b, c or the field winding: row 0 to 3
  kGates,      ///< a drivebench_gates
  kLegsOff,    ///< legs that are off: 1 a, 2 b, 4 c
  kLoad,       ///< load torque
  kClear,      ///< a change from 0 clears the latched faults
  kParameter,  ///< row of the axis' parameters
  kFault,      ///< row of the bench's injectables
  kSignal      ///< row of the bench's signals
};

struct Variable {
  std::string name;
  std::string unit;
  std::string meaning;
  Causality causality;
  Type type;
  double start;  ///< of an output: unused
  double minimum;
  double maximum;  ///< both infinite: without limits
  Purpose purpose;
  std::uint32_t axis;
  std::size_t row;
};

/// Whether the axis has a lease of its own, and so commands: not where it shares the amplifier of another
/// one.
using IsCommanded = std::vector<bool>;

/// All variables of the bench; the place in the list is the value reference. In a bench of several axes the
/// names begin with that of the axis and a point.
std::vector<Variable> variables_of(const drivebench_description& bench, const IsCommanded& is_commanded);

/// The gates with which an axis starts: what its drive takes as set-points.
std::uint32_t usual_gates(const drivebench_axis& axis) noexcept;

/// The instantiation token: it ties a model description to its bench.
std::string token_of(const drivebench_description& bench);

/// A name that C and the file system take as well: letters, digits and underscores.
std::string identifier_of(std::string_view name);

}  // namespace drivebench::fmi
