#pragma once

#include <bench.pb.h>

#include <cstdint>
#include <stdexcept>
#include <string>

/// The requests of a client over any link, and the refusal of the bench.
namespace drivebench::link {

/// The bench refused a request; the link goes on. what() is the bench's sentence.
class RefusalError : public std::runtime_error {
 public:
  explicit RefusalError(const v1::Refusal& refusal)
      : std::runtime_error(refusal.message()), code_(refusal.code()), field_(refusal.field()) {}

  v1::RefusalCode code() const noexcept { return code_; }
  const std::string& field() const noexcept { return field_; }  ///< the refused field; may be empty

 private:
  v1::RefusalCode code_;
  std::string field_;
};

/// A command for an axis, in answer to the sample of `tick`: voltages, or currents with GATES_CURRENT. A
/// machine ignores terminals that it lacks; `f` is the field winding.
struct AxisCommand {
  std::uint32_t axis = 0;
  std::uint64_t tick = 0;
  v1::Gates gates = v1::GATES_OFF;
  double u_a_v = 0.0;
  double u_b_v = 0.0;
  double u_c_v = 0.0;
  double u_f_v = 0.0;
  double i_a_a = 0.0;
  double i_b_a = 0.0;
  double i_c_a = 0.0;
  double i_f_a = 0.0;
};

struct LoadChange {
  double load_nm = 0.0;
  std::uint64_t ramp_ticks = 0;  ///< 0: a step
  std::uint64_t at_tick = 0;     ///< 0: as soon as possible
};

/// A new value of a parameter.
struct ParameterChange {
  std::string name{};
  double value = 0.0;
  std::uint64_t ramp_ticks = 0;  ///< 0: a step
  std::uint64_t at_tick = 0;     ///< 0: as soon as possible
};

/// An injected fault; a value of 0 ends it.
struct FaultInjection {
  std::string name{};
  double value = 0.0;
  std::uint64_t at_tick = 0;  ///< 0: as soon as possible
};

}  // namespace drivebench::link
